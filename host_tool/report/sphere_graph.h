// A drawing of the heads' overlaps: each head at its direction on a map of the sphere, with lines to overlapping heads.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace nodal::host {

struct GraphNode {
  std::string name;
  double yaw_deg = 0;    ///< to the right
  double pitch_deg = 0;  ///< up
  bool faint = false;    ///< drawn faintly, because its direction is uncertain
};

struct GraphLink {
  std::size_t a = 0, b = 0;
  double share = 0;      ///< 0..1: line width relative to the widest
  double agreement = 0;  ///< 0..1: green, orange or, below kPoorAgreement, red and dashed
  std::string remark;    ///< shown when the mouse is over it
};

inline constexpr double kPoorAgreement = 0.4;

/// SVG. Links take the shorter way round; those across the back leave the map on one side and enter on the other.
std::string sphere_graph(const std::vector<GraphNode>& nodes, const std::vector<GraphLink>& links);

}  // namespace nodal::host
