// A drawing of the heads' overlaps: each head at its direction on a map of the sphere, joined to those it overlaps with.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace nodal::host {

struct GraphNode {
  std::string name;
  double yaw_deg = 0;    ///< to the right
  double pitch_deg = 0;  ///< up
  bool faint = false;    ///< drawn as one that is not sure
};

struct GraphLink {
  std::size_t a = 0, b = 0;
  double share = 0;      ///< 0..1: how thick it is drawn, against the thickest
  double agreement = 0;  ///< 0..1: green, orange or red
  std::string told;      ///< shown where the mouse rests on it
};

/// SVG. Links go the short way round; those over the back of the sphere leave on one side and come in on the other.
std::string sphere_graph(const std::vector<GraphNode>& nodes, const std::vector<GraphLink>& links);

}  // namespace nodal::host
