#include "host_tool/report/html_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "host_tool/report/sphere_script.h"
#include "stitch/media/xml_text.h"

namespace nodal::host {
namespace {

constexpr std::array kColours{"#0b6e99", "#d9480f", "#2b8a3e", "#862e9c", "#c92a2a", "#5f3dc4", "#087f5b", "#a61e4d"};

constexpr const char* kStyle =
    "body{font:15px/1.5 system-ui,sans-serif;color:#222;max-width:1100px;margin:2em auto;padding:0 1em}"
    "h1{font-size:1.6em;margin-bottom:0}h2{font-size:1.15em;margin:2em 0 .5em;border-bottom:1px solid #ddd}"
    "details{margin:2em "
    "0}summary{font-size:1.15em;cursor:pointer}p.summary{color:#555;margin-top:.2em}p.warning{background:#fff3bf;"
    "border-left:4px solid #f08c00;padding:.5em 1em}"
    "table{border-collapse:collapse;font-size:14px}td,th{padding:.25em .8em;border-bottom:1px solid #eee;"
    "text-align:left}td.n{text-align:right;font-variant-numeric:tabular-nums}"
    "figure{display:inline-block;margin:0 1em 1em 0;vertical-align:top;max-width:340px}figure img{width:100%}"
    "figcaption{font-size:13px;color:#555}svg{background:#fafafa;border:1px solid #eee;max-width:100%;height:auto}"
    "figure canvas{display:block;width:100%;height:min(60vh,60vw);touch-action:none;cursor:grab}"
    "figure [hidden]{display:none}div.tools{margin:.4em 0}div.tools button{font:inherit;padding:.2em .8em;"
    "margin-right:.5em;min-width:2.4em;min-height:2em}"
    "div.table{overflow-x:auto}figure.wide{display:block;max-width:100%;margin-right:0}figure.wide "
    "img{width:auto;max-width:100%}"
    "@media(prefers-color-scheme:dark){body{background:#1b1b1b;color:#ddd}svg{background:#eee}p.warning{color:#222}"
    "td,th{border-color:#333}p.summary,figcaption{color:#aaa}}";

/// Beside the colours, so that curves can be distinguished without them.
constexpr std::array kDashes{"", "7 3", "2 3", "9 3 2 3", "4 4"};

/// RFC 4648.
std::string base64(std::span<const std::uint8_t> bytes) {
  constexpr const char* kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t left = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) group = group << 8 | (k < left ? bytes[i + k] : 0U);
    for (std::size_t k = 0; k < 4; ++k) out += k <= left ? kDigits[group >> (18 - 6 * k) & 63U] : '=';
  }
  return out;
}

bool is_number(const std::string& text) {
  return !text.empty() && text.find_first_of("0123456789") != std::string::npos &&
         text.find_first_not_of("0123456789.,+-eE %/°±") == std::string::npos;
}

struct Axis {
  double low = 0, high = 1, step = 0.2;
};

/// A label of a logarithmic axis: the numbers 1, 2 and 5 times a power of ten, `steps` from 1 on; 3 steps are a factor
/// of ten.
double round_number(int steps) {
  constexpr std::array kRound{1.0, 2.0, 5.0};
  const int power = static_cast<int>(std::floor(steps / 3.0));
  return kRound[static_cast<std::size_t>(steps - 3 * power)] * std::pow(10.0, power);
}
/// The largest such number of steps up to a value, given by its logarithm; one more for the end of an axis.
int round_steps(double log_value) {
  int steps = 3 * static_cast<int>(std::floor(log_value));
  while (std::log10(round_number(steps + 1)) <= log_value + 1e-9) ++steps;
  return steps;
}
Axis log_axis_of(double low, double high) {
  const double first = std::log10(round_number(round_steps(low)));
  int last = round_steps(high);
  if (std::log10(round_number(last)) < high - 1e-9 || last == round_steps(low)) ++last;
  return {first, std::log10(round_number(last)), 0};
}

/// About five round steps over the values.
Axis axis_of(double low, double high) {
  if (!(high > low)) {
    const double about = std::max(std::abs(low), 1e-9);
    low -= 0.5 * about;
    high += 0.5 * about;
  }
  const double rough = (high - low) / 5;
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  double step = 10 * power;
  for (const double round : {5.0, 2.0, 1.0}) {
    if (round * power >= rough) step = round * power;
  }
  return {std::floor(low / step) * step, std::ceil(high / step) * step, step};
}

constexpr double kWidth = 520, kHeight = 300, kLeft = 62, kRight = 14, kTop = 26, kBottom = 42;

double place_x(const Axis& axis, double x) {
  return kLeft + (x - axis.low) / (axis.high - axis.low) * (kWidth - kLeft - kRight);
}
double place_y(const Axis& axis, double y) {
  return kHeight - kBottom - (y - axis.low) / (axis.high - axis.low) * (kHeight - kTop - kBottom);
}

std::string grid(const Axis& x, const Axis& y, bool log_y) {
  std::string svg;
  const auto line = [&](double x0, double y0, double x1, double y1) {
    svg +=
        fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"#ddd\"/>", x0, y0, x1, y1);
  };
  for (int k = 0; x.low + k * x.step <= x.high + 1e-9 * x.step; ++k) {
    const double value = x.low + k * x.step;
    line(place_x(x, value), kTop, place_x(x, value), kHeight - kBottom);
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{:.4g}</text>", place_x(x, value),
                       kHeight - kBottom + 15, std::abs(value) < 1e-12 ? 0 : value);
  }
  const auto mark_y = [&](double value, double shown) {
    line(kLeft, place_y(y, value), kWidth - kRight, place_y(y, value));
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"end\">{:.4g}</text>", kLeft - 5,
                       place_y(y, value) + 4, shown);
  };
  if (log_y) {
    // Over three decades only the powers of ten have room.
    const int every = y.high - y.low > 3 ? 3 : 1;
    for (int k = round_steps(y.low); std::log10(round_number(k)) <= y.high + 1e-9; ++k) {
      if (k % every == 0) mark_y(std::log10(round_number(k)), round_number(k));
    }
    return svg;
  }
  for (int k = 0; y.low + k * y.step <= y.high + 1e-9 * y.step; ++k) {
    const double value = y.low + k * y.step;
    mark_y(value, std::abs(value) < 1e-12 ? 0 : value);
  }
  return svg;
}

std::string figure(std::span<const std::uint8_t> file, std::string_view caption, std::string_view attributes) {
  const bool jpeg = file.size() > 1 && file[0] == 0xFF && file[1] == 0xD8;
  const std::string text = html_escaped(caption);
  return fmt::format("<figure{}><img src=\"data:image/{};base64,{}\" alt=\"{}\"><figcaption>{}</figcaption></figure>\n",
                     attributes, jpeg ? "jpeg" : "png", base64(file), text, text);
}

}  // namespace

std::string html_escaped(std::string_view text) { return media::xml_escaped(text); }

HtmlReport::HtmlReport(std::string_view title, std::string_view summary) : title_(html_escaped(title)) {
  if (!title_.empty()) body_ = "<h1>" + title_ + "</h1>\n<p class=\"summary\">" + html_escaped(summary) + "</p>\n";
}

void HtmlReport::heading(std::string_view text) { body_ += "<h2>" + html_escaped(text) + "</h2>\n"; }
void HtmlReport::paragraph(std::string_view text) { body_ += "<p>" + html_escaped(text) + "</p>\n"; }
void HtmlReport::warning(std::string_view text) { body_ += "<p class=\"warning\">" + html_escaped(text) + "</p>\n"; }

void HtmlReport::table(const std::vector<std::string>& titles, const std::vector<std::vector<std::string>>& rows) {
  // A table that is wider than the window is scrolled, by keys, too.
  body_ += "<div class=\"table\" tabindex=\"0\"><table><tr>";
  for (const std::string& title : titles) body_ += title.empty() ? "<td></td>" : "<th>" + html_escaped(title) + "</th>";
  body_ += "</tr>\n";
  for (const auto& row : rows) {
    body_ += "<tr>";
    for (const std::string& cell : row) {
      body_ += (is_number(cell) ? "<td class=\"n\">" : "<td>") + html_escaped(cell) + "</td>";
    }
    body_ += "</tr>\n";
  }
  body_ += "</table></div>\n";
}

void HtmlReport::pictures(const std::vector<std::pair<std::vector<std::uint8_t>, std::string>>& files_and_captions) {
  body_ += "<div>\n";
  for (const auto& [file, caption] : files_and_captions) {
    body_ += figure(file, caption, files_and_captions.size() == 1 ? " class=\"wide\"" : "");
  }
  body_ += "</div>\n";
}

void HtmlReport::sphere(std::span<const std::uint8_t> file, std::string_view caption,
                        const std::array<double, 4>& part) {
  body_ += figure(file, caption,
                  fmt::format(" class=\"wide sphere\" data-part=\"{},{},{},{}\"", part[0], part[1], part[2], part[3]));
  has_sphere_ = true;
}

void HtmlReport::chart(std::string_view title, std::string_view x_label, std::string_view y_label,
                       const std::vector<ChartSeries>& series, bool log_y) {
  const auto shown = [log_y](double y) { return log_y ? std::log10(y) : y; };
  double x_low = HUGE_VAL, x_high = -HUGE_VAL, y_low = HUGE_VAL, y_high = -HUGE_VAL;
  for (const ChartSeries& s : series) {
    for (const auto& [x, y] : s.points) {
      if (!std::isfinite(x) || !std::isfinite(shown(y))) continue;
      x_low = std::min(x_low, x), x_high = std::max(x_high, x);
      y_low = std::min(y_low, shown(y)), y_high = std::max(y_high, shown(y));
    }
  }
  if (!(x_high >= x_low)) return;
  const Axis x_axis = axis_of(x_low, x_high);
  const Axis y_axis = log_y ? log_axis_of(y_low, y_high) : axis_of(y_low, y_high);
  std::string svg = fmt::format(
      "<svg width=\"{0:.0f}\" height=\"{1:.0f}\" viewBox=\"0 0 {0:.0f} {1:.0f}\" role=\"img\" "
      "aria-label=\"{2}\" font-family=\"sans-serif\" font-size=\"11\">",
      kWidth, kHeight, html_escaped(fmt::format("{}: {} over {}", title, y_label, x_label)));
  svg += grid(x_axis, y_axis, log_y);
  for (std::size_t n = 0; n < series.size(); ++n) {
    const char* colour = kColours[n % kColours.size()];
    const char* dashes = kDashes[n % kDashes.size()];
    svg += fmt::format("<polyline fill=\"none\" stroke-width=\"1.6\" stroke=\"{}\" stroke-dasharray=\"{}\" points=\"",
                       colour, dashes);
    for (const auto& [x, y] : series[n].points) {
      if (!std::isfinite(x) || !std::isfinite(shown(y))) continue;
      svg += fmt::format("{:.1f},{:.1f} ", place_x(x_axis, x), place_y(y_axis, shown(y)));
    }
    svg += "\"/>";
    if (series.size() > 1) {
      const double y = kTop + 14 + 13 * static_cast<double>(n);
      svg += fmt::format(
          "<line x1=\"{:.0f}\" y1=\"{:.0f}\" x2=\"{:.0f}\" y2=\"{:.0f}\" stroke-width=\"1.6\" stroke=\"{}\" "
          "stroke-dasharray=\"{}\"/><text x=\"{:.0f}\" y=\"{:.0f}\">{}</text>",
          kLeft + 8, y - 4, kLeft + 34, y - 4, colour, dashes, kLeft + 40, y, html_escaped(series[n].name));
    }
  }
  svg += fmt::format("<text x=\"{:.0f}\" y=\"16\" font-size=\"13\" font-weight=\"bold\">{}</text>", kLeft,
                     html_escaped(title));
  svg += fmt::format("<text x=\"{:.0f}\" y=\"{:.0f}\" text-anchor=\"middle\">{}</text>", (kLeft + kWidth - kRight) / 2,
                     kHeight - 8, html_escaped(x_label));
  svg += fmt::format("<text transform=\"translate(13 {:.0f}) rotate(-90)\" text-anchor=\"middle\">{}</text></svg>\n",
                     (kTop + kHeight - kBottom) / 2, html_escaped(y_label));
  body_ += svg;
}

void HtmlReport::drawing(std::string_view svg) { body_ += svg; }

void HtmlReport::details(std::string_view title, const HtmlReport& page) {
  std::string body = page.body_;
  // A page has one title.
  for (const auto& [tag, lower] : {std::pair("<h1>", "<h2>"), std::pair("</h1>", "</h2>")}) {
    if (const std::size_t at = body.find(tag); at != std::string::npos) body.replace(at, std::strlen(tag), lower);
  }
  has_sphere_ = has_sphere_ || page.has_sphere_;
  body_ += "<details><summary>" + html_escaped(title) + "</summary>\n" + body + "</details>\n";
}

std::string HtmlReport::finish() const {
  return "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
         "<meta name=\"viewport\" content=\"width=device-width\"><title>" +
         title_ + "</title><style>" + kStyle + "</style></head>\n<body><main>\n" + body_ + "</main>\n" +
         (has_sphere_ ? std::string("<script>") + kSphereScript + "</script>\n" : "") + "</body></html>\n";
}

}  // namespace nodal::host
