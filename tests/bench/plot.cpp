#include "plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "stitch/media/xml_text.h"

namespace nodal::bench {
namespace {

constexpr double kWidth = 760, kHeight = 490;                         // px of the picture
constexpr double kLeft = 70, kTop = 96, kRight = 730, kBottom = 415;  // px, bounds of the axes
constexpr std::array kColours{"#0b6e99", "#b3470f", "#3a7d34", "#6b4a9e"};

std::string text(double x, double y, std::string_view anchor, std::string_view more, std::string_view what) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" {}>{}</text>\n", x, y, anchor, more,
                     media::xml_escaped(what));
}

std::string line(double x0, double y0, double x1, double y1, std::string_view colour) {
  return fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\"/>\n", x0, y0, x1, y1,
                     colour);
}

/// From 0 to a round number, in at most eight round steps.
struct Axis {
  double step = 1;
  double end = 1;

  explicit Axis(double largest) {
    const double power = std::pow(10, std::floor(std::log10(largest / 8)));
    for (const double round : {1.0, 2.0, 5.0, 10.0}) {
      step = round * power;
      if (largest <= 8 * step) break;
    }
    end = std::ceil(largest / step - 1e-9) * step;
  }
  int ticks() const { return static_cast<int>(std::lround(end / step)); }
};

struct Frame {
  Axis x, y;
  double at_x(double value) const { return kLeft + value / x.end * (kRight - kLeft); }
  double at_y(double value) const { return kBottom - value / y.end * (kBottom - kTop); }
};

std::string axes(const Frame& frame, const Plot& plot) {
  std::string svg;
  for (int k = 0; k <= frame.x.ticks(); ++k) {
    const double value = k * frame.x.step, at = frame.at_x(value);
    svg += line(at, kTop, at, kBottom, "#e4e4e4") + text(at, kBottom + 18, "middle", "", fmt::format("{:g}", value));
  }
  for (int k = 0; k <= frame.y.ticks(); ++k) {
    const double value = k * frame.y.step, at = frame.at_y(value);
    svg += line(kLeft, at, kRight, at, "#e4e4e4") + text(kLeft - 8, at + 4, "end", "", fmt::format("{:g}", value));
  }
  svg += line(kLeft, kBottom, kRight, kBottom, "#444") + line(kLeft, kTop, kLeft, kBottom, "#444");
  svg += text((kLeft + kRight) / 2, kBottom + 42, "middle", "", plot.x_label);
  svg += text(kLeft, kHeight - 10, "start", "font-size=\"11\" style=\"fill:#666\"", plot.note);
  const double middle = (kTop + kBottom) / 2;
  return svg + text(22, middle, "middle", fmt::format("transform=\"rotate(-90 22 {:.1f})\"", middle), plot.y_label);
}

std::string curve(const Frame& frame, const PlotSeries& series, const char* colour) {
  const auto [least, most] = std::ranges::minmax(series.points, {}, &PlotPoint::x);
  std::string svg = "<polyline fill=\"none\" stroke-width=\"1.5\" stroke=\"" + std::string(colour) + "\" points=\"";
  constexpr int kSteps = 60;
  for (int k = 0; k <= kSteps; ++k) {
    const double x = least.x + (most.x - least.x) * k / kSteps;
    svg += fmt::format("{:.1f},{:.1f} ", frame.at_x(x), frame.at_y(series.law(x)));
  }
  svg += "\"/>\n";
  for (const PlotPoint& point : series.points) {
    svg += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" fill=\"{}\"><title>{:g}: {:.3f}</title></circle>\n",
                       frame.at_x(point.x), frame.at_y(point.y), colour, point.x, point.y);
  }
  return svg;
}

}  // namespace

std::string to_svg(const Plot& plot) {
  double x = 0, y = 0;
  for (const PlotSeries& series : plot.series) {
    for (const PlotPoint& point : series.points) {
      x = std::max(x, point.x);
      y = std::max({y, point.y, series.law(point.x)});
    }
  }
  const Frame frame{Axis(x), Axis(y)};
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:g} {1:g}\" width=\"{0:g}\" height=\"{1:g}\" "
      "font-family=\"sans-serif\" font-size=\"13\" fill=\"#222\">\n<rect width=\"100%\" height=\"100%\" "
      "fill=\"white\"/>\n",
      kWidth, kHeight);
  svg += text(kLeft, 26, "start", "font-size=\"16\" font-weight=\"bold\"", plot.title);
  svg += axes(frame, plot);
  for (std::size_t s = 0; s < plot.series.size(); ++s) {
    const PlotSeries& series = plot.series[s];
    const char* colour = kColours.at(s);
    svg += curve(frame, series, colour);
    svg += text(kLeft, 50 + 18 * static_cast<double>(s), "start", fmt::format("style=\"fill:{}\"", colour),
                series.name + ": " + series.law_text);
  }
  return svg + "</svg>\n";
}

}  // namespace nodal::bench
