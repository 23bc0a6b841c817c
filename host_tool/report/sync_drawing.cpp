// The sync report's drawing: every head's offset over the sets, and the state of the genlock.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "host_tool/console/quantities.h"
#include "host_tool/report/html_report.h"
#include "host_tool/report/sync_report.h"

namespace nodal::host {
namespace {

constexpr double kLeft = 80, kTop = 64, kWide = 760, kHigh = 360, kRight = 280, kBelow = 64;

/// Colours that colour-blind readers can distinguish too (Okabe and Ito).
constexpr std::array<std::string_view, 8> kColours{"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                                   "#e69f00", "#56b4e9", "#000000", "#999999"};
struct Band {
  std::string_view state, fill;
};
constexpr std::array<Band, 5> kBands{Band{"off", "#f4f4f4"}, Band{"acquiring", "#fff3cd"}, Band{"locked", "#e3f4e6"},
                                     Band{"holdover", "#fde8c8"}, Band{"lost", "#f9d6d5"}};

std::string time(std::int64_t ns) { return show_duration(static_cast<std::uint64_t>(ns)); }

/// Shows microseconds in lock and milliseconds in free run on one axis: linear up to a microsecond, logarithmic beyond.
double bent(double us) { return std::copysign(std::log10(1 + std::abs(us)), us); }

class Axes {
 public:
  Axes(std::uint64_t first_set, std::uint64_t last_set, std::int64_t worst_ns)
      : first_(static_cast<double>(first_set)),
        wide_(std::max(1.0, static_cast<double>(last_set) - first_)),
        decades_(std::max(1, static_cast<int>(std::ceil(bent(static_cast<double>(worst_ns) / 1000))))) {}

  double x(std::uint64_t set) const { return kLeft + kWide * (static_cast<double>(set) - first_) / wide_; }
  double y(double us) const { return kTop + kHigh / 2 * (1 - bent(us) / bent(std::pow(10.0, decades_))); }

  /// Lines at 1, 2, 5, 10 .. microseconds, labelled where there is room: they make the non-linear scale visible.
  std::string grid() const {
    std::string svg = line(0, "0");
    double worded = y(0);
    for (int k = 0; k <= decades_; ++k) {
      for (const int step : {1, 2, 5}) {
        if (k == decades_ && step > 1) break;
        const double us = step * std::pow(10.0, k);
        const bool room = worded - y(us) >= 16 && (k == decades_ || y(us) - kTop >= 16);
        const std::string name = room ? time(std::llround(us * 1000)) : "";
        if (room) worded = y(us);
        svg += line(us, room ? "+" + name : "") + line(-us, room ? "−" + name : "");
      }
    }
    return svg;
  }

 private:
  std::string line(double us, const std::string& name) const {
    return fmt::format(
        "<line x1=\"{}\" x2=\"{}\" y1=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"#{}\"/>\n"
        "<text x=\"{}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>\n",
        kLeft, kLeft + kWide, y(us), y(us), name.empty() ? "e4e4e4" : "ccc", kLeft - 8, y(us) + 4, name);
  }

  double first_, wide_;
  int decades_;
};

/// The background: the genlock's state, from each set to the next.
std::string bands(const std::vector<wire::RaymapHeader>& sets, const Axes& axes) {
  std::string svg;
  for (std::size_t i = 0; i < sets.size();) {
    std::size_t end = i;
    while (end < sets.size() && sets[end].genlock() == sets[i].genlock()) ++end;
    const auto band =
        std::find_if(kBands.begin(), kBands.end(), [&](const Band& b) { return b.state == sets[i].genlock(); });
    const double from = axes.x(sets[i].set());
    const double to = axes.x(end < sets.size() ? sets[end].set() : sets.back().set());
    svg += fmt::format("<rect x=\"{:.1f}\" y=\"{}\" width=\"{:.1f}\" height=\"{}\" fill=\"{}\"/>\n", from, kTop,
                       to - from, kHigh, band == kBands.end() ? "#ffffff" : band->fill);
    if (to - from > 60) {
      svg += fmt::format("<text x=\"{:.1f}\" y=\"{}\" fill=\"#666\">{}</text>\n", from + 4, kTop - 6,
                         html_escaped(sets[i].genlock()));
    }
    i = end;
  }
  return svg;
}

std::string style(std::size_t head) {
  return fmt::format("fill=\"none\" stroke=\"{}\" stroke-width=\"1.5\"{}", kColours[head % kColours.size()],
                     head >= kColours.size() ? " stroke-dasharray=\"5 3\"" : "");
}

/// Interrupted where the head was missing or sets did not arrive.
std::string curve(const std::vector<wire::RaymapHeader>& sets, const SyncReport::Head& head, std::size_t h,
                  const Axes& axes) {
  std::string svg, points;
  const auto flush = [&] {
    if (!points.empty()) svg += fmt::format("<polyline {} points=\"{}\"/>\n", style(h), points);
    points.clear();
  };
  for (std::size_t i = 0; i < sets.size(); ++i) {
    if (!head.offsets[i] || (i > 0 && sets[i].set() != sets[i - 1].set() + 1)) flush();
    if (!head.offsets[i]) continue;
    points +=
        fmt::format("{:.1f},{:.1f} ", axes.x(sets[i].set()), axes.y(static_cast<double>(*head.offsets[i]) / 1000));
  }
  flush();
  return svg;
}

std::string legend(const SyncReport::Head& head, std::size_t h) {
  const double x = kLeft + kWide + 16;
  const double y = kTop + 12 + 20 * static_cast<double>(h);
  return fmt::format("<path d=\"M{} {}h24\" {}/>\n<text x=\"{}\" y=\"{}\">{}: worst {}{}</text>\n", x, y - 4, style(h),
                     x + 32, y, html_escaped(head.name), time(head.worst_ns),
                     head.missing > 0 ? fmt::format(", missing in {}", counted(head.missing, "set")) : "");
}

}  // namespace

std::string SyncReport::svg() const {
  const std::vector<Head> all = heads();
  std::int64_t worst = 0;
  for (const Head& head : all) worst = std::max(worst, head.worst_ns);
  const std::uint64_t first = sets_.empty() ? 0 : sets_.front().set();
  const std::uint64_t last = sets_.empty() ? 0 : sets_.back().set();
  const Axes axes(first, last, worst);
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"100%\" style=\"max-width:{0}px\" "
      "font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
      "<text x=\"{2}\" y=\"26\" font-size=\"15\">When each head was in the middle of its exposure, compared with the "
      "median of its set</text>\n",
      kLeft + kWide + kRight, kTop + kHigh + kBelow, kLeft);
  svg += bands(sets_, axes) + axes.grid();
  for (std::size_t h = 0; h < all.size(); ++h) svg += curve(sets_, all[h], h, axes) + legend(all[h], h);
  svg +=
      fmt::format("<text x=\"{}\" y=\"{}\">set {}</text>\n<text x=\"{}\" y=\"{}\" text-anchor=\"end\">set {}</text>\n",
                  kLeft, kTop + kHigh + 20, first, kLeft + kWide, kTop + kHigh + 20, last);
  const SyncFigures together = spread();
  svg += fmt::format("<text x=\"{}\" y=\"{}\">spread: median {}, p99 {}, worst {}; {} sets lost</text>\n</svg>\n",
                     kLeft, kTop + kHigh + 46, time(together.median_ns), time(together.p99_ns), time(together.worst_ns),
                     sets_lost());
  return svg;
}

}  // namespace nodal::host
