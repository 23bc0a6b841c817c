// The minimum cut of a graph with two terminals.
#pragma once

#include <cstdint>
#include <vector>

namespace nodal::seams {

/// Finds the cut of least capacity between a source and a sink by Boykov and Kolmogorov's algorithm ("An Experimental
/// Comparison of Min-Cut/Max-Flow Algorithms for Energy Minimization in Vision", PAMI 2004, section 3): a search tree
/// grows from each terminal; where they meet, flow is pushed along the path, and nodes that lose their parent look for
/// another one. Fast on grids, where paths are short. Capacities are integers, so the result does not depend on
/// rounding.
///
/// Threading: thread-bound. Memory: 32 bytes a node, 32 bytes an edge.
class MaxFlow {
 public:
  using Capacity = std::int64_t;

  /// Capacities of all nodes' edges from the source and to the sink are 0 at first.
  explicit MaxFlow(int nodes);
  /// Makes room for this many calls of add_edge().
  void reserve(std::size_t edges) { arcs_.reserve(2 * edges); }
  /// Adds to the capacities from the source to the node and from the node to the sink; both may be negative, because
  /// only their difference affects the cut.
  void add_terminals(int node, Capacity from_source, Capacity to_sink);
  /// Adds an edge with a capacity, 0 or more, in each direction.
  void add_edge(int from, int to, Capacity forth, Capacity back);

  /// Call once, after the last edge.
  void solve();
  /// After solve(): whether the cut leaves the node on the source's side. Nodes that either side may have are the
  /// source's.
  bool with_source(int node) const { return nodes_[static_cast<std::size_t>(node)].tree != Tree::kSink; }

 private:
  enum class Tree : std::uint8_t { kNone, kSource, kSink };
  /// An arc's index; arcs 2 k and 2 k + 1 are the two directions of an edge.
  using Arc = std::int32_t;
  static constexpr Arc kNoArc = -1, kTerminal = -2;
  struct Node {
    Capacity terminal = 0;  ///< > 0: left from the source; < 0: left to the sink
    Arc first = kNoArc;
    Arc parent = kNoArc;       ///< from this node to its parent
    std::int32_t checked = 0;  ///< the step at which `depth` was correct
    std::int32_t depth = 0;    ///< arcs to the terminal
    Tree tree = Tree::kNone;
    bool queued = false;
  };
  struct HalfEdge {
    std::int32_t head = 0;
    Arc next = kNoArc;
    Capacity left = 0;
  };

  Node& node(std::int32_t n) { return nodes_[static_cast<std::size_t>(n)]; }
  HalfEdge& arc(Arc a) { return arcs_[static_cast<std::size_t>(a)]; }
  /// What is left on the way between a node and its neighbour over `a`, in the direction of the tree's flow, if the
  /// flow passes the node first (source) or last (sink).
  Capacity left_along(Tree tree, Arc a) { return tree == Tree::kSource ? arc(a).left : arc(a ^ 1).left; }
  void activate(std::int32_t n);
  /// Grows the trees from active nodes until they meet. Returns the arc from the source's tree to the sink's, or
  /// kNoArc.
  Arc grow();
  void augment(Arc meeting);
  void adopt_orphans();
  void adopt(std::int32_t orphan);
  /// Whether the node's chain of parents ends at a terminal; its length in arcs is in the node's depth then.
  bool rooted(std::int32_t n);

  std::vector<Node> nodes_;
  std::vector<HalfEdge> arcs_;
  std::vector<std::int32_t> active_;  ///< a queue: [next_active_, end)
  std::size_t next_active_ = 0;
  std::vector<std::int32_t> orphans_;
  std::int32_t step_ = 0;
};

}  // namespace nodal::seams
