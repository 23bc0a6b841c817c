#include "host_tool/report/sphere_graph.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_tool/report/html_report.h"

namespace nodal::host {
namespace {

constexpr double kGraphWidth = 760, kGraphHeight = 400, kMap = 360;  // the legend is below the map
constexpr double kMinStroke = 1.5, kMaxStroke = 9, kRadius = 15;
constexpr double kNameHeight = 9.5, kNameMargin = 2;
constexpr double kGood = 0.8;

const char* colour_of(double agreement) {
  return agreement >= kGood ? "#2b8a3e" : agreement >= kPoorAgreement ? "#f08c00" : "#c92a2a";
}

double x_of(const GraphNode& node) {
  const double turns = node.yaw_deg / 360 + 0.5;
  return kGraphWidth * (turns - std::floor(turns));
}
double y_of(const GraphNode& node) { return kMap * std::clamp(0.5 - node.pitch_deg / 180, 0.045, 0.955); }

std::string line(double x0, double y0, double x1, double y1, const GraphLink& link) {
  const double stroke = kMinStroke + (kMaxStroke - kMinStroke) * std::clamp(link.share, 0.0, 1.0);
  return fmt::format(
      "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" stroke-width=\"{:.1f}\" "
      "stroke-opacity=\"0.75\"{}><title>{}</title></line>",
      x0, y0, x1, y1, colour_of(link.agreement), stroke,
      link.agreement < kPoorAgreement ? " stroke-dasharray=\"6 5\""
      : link.agreement < kGood        ? " stroke-dasharray=\"14 4\""
                                      : "",
      html_escaped(link.remark));
}

std::string drawn(const GraphLink& link, const std::vector<GraphNode>& nodes) {
  const GraphNode &a = nodes[link.a], &b = nodes[link.b];
  const double xa = x_of(a), xb = x_of(b);
  const double way = xb - xa > kGraphWidth / 2 ? -kGraphWidth : xb - xa < -kGraphWidth / 2 ? kGraphWidth : 0;
  std::string svg = line(xa, y_of(a), xb + way, y_of(b), link);
  if (way != 0) svg += line(xa - way, y_of(a), xb, y_of(b), link);
  return svg;
}

std::string drawn(const GraphNode& node, double x) {
  // At most half of the name's width: no letter is wider than the font is high. Nearer to an edge, the name begins or
  // ends there, so that it is not cut off, whatever the font.
  const double half = kNameHeight / 2 * static_cast<double>(node.name.size());
  const bool at_left = x < half, at_right = !at_left && x > kGraphWidth - half;
  std::string svg =
      fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.0f}\" fill=\"{}\" stroke=\"{}\" stroke-width=\"1.5\"{}/>",
                  x, y_of(node), kRadius, node.faint ? "#fff3bf" : "#fff", node.faint ? "#f08c00" : "#333",
                  node.faint ? " stroke-dasharray=\"3 3\"" : "");
  return svg +
         fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" fill=\"#222\" font-size=\"{}\">{}</text>",
                     at_left    ? kNameMargin
                     : at_right ? kGraphWidth - kNameMargin
                                : x,
                     y_of(node) + 3.5,
                     at_left    ? "start"
                     : at_right ? "end"
                                : "middle",
                     kNameHeight, html_escaped(node.name));
}

std::string legend() {
  std::string svg;
  double x = 12;
  for (const auto& [agreement, text] : {std::pair{1.0, "agrees"}, {0.5, "agrees in part"}, {0.0, "does not agree"}}) {
    const GraphLink link{0, 0, 0.4, agreement, text};
    svg += line(x, kGraphHeight - 18, x + 34, kGraphHeight - 18, link);
    svg += fmt::format("<text x=\"{:.0f}\" y=\"{:.0f}\">{}</text>", x + 42, kGraphHeight - 14, text);
    x += 150;
  }
  return svg + fmt::format("<text x=\"{:.0f}\" y=\"{:.0f}\">thicker: they share more of the sphere</text>", x,
                           kGraphHeight - 14);
}

}  // namespace

std::string sphere_graph(const std::vector<GraphNode>& nodes, const std::vector<GraphLink>& links) {
  std::string svg = fmt::format(
      "<svg width=\"{0:.0f}\" height=\"{1:.0f}\" viewBox=\"0 0 {0:.0f} {1:.0f}\" role=\"img\" "
      "aria-label=\"The heads' directions on the sphere, joined where they overlap\" "
      "font-family=\"sans-serif\" font-size=\"11\">",
      kGraphWidth, kGraphHeight);
  for (int k = 1; k < 4; ++k) {
    svg += fmt::format("<line x1=\"{0:.1f}\" y1=\"0\" x2=\"{0:.1f}\" y2=\"{1:.0f}\" stroke=\"#e3e3e3\"/>",
                       kGraphWidth * k / 4, kMap);
    svg += fmt::format("<line x1=\"0\" y1=\"{0:.1f}\" x2=\"{1:.0f}\" y2=\"{0:.1f}\" stroke=\"#e3e3e3\"/>", kMap * k / 4,
                       kGraphWidth);
  }
  for (const auto& [at, text] : {std::pair{0.25, "left"}, {0.5, "front"}, {0.75, "right"}}) {
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.0f}\" text-anchor=\"middle\" fill=\"#888\">{}</text>",
                       kGraphWidth * at, kMap - 4, text);
  }
  // Links with the highest agreement are drawn last, on top.
  std::vector<GraphLink> sorted = links;
  std::ranges::stable_sort(sorted, std::less<>(), &GraphLink::agreement);
  for (const GraphLink& link : sorted) svg += drawn(link, nodes);
  for (const GraphNode& node : nodes) {
    const double x = x_of(node);
    svg += drawn(node, x);
    if (x < kRadius) svg += drawn(node, x + kGraphWidth);  // a head that looks back is drawn half on each side
    if (x > kGraphWidth - kRadius) svg += drawn(node, x - kGraphWidth);
  }
  return svg + legend() + "</svg>\n";
}

}  // namespace nodal::host
