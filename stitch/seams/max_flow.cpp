#include "stitch/seams/max_flow.h"

#include <algorithm>
#include <limits>

namespace nodal::seams {

MaxFlow::MaxFlow(int nodes) : nodes_(static_cast<std::size_t>(nodes)) {}

void MaxFlow::add_terminals(int n, Capacity from_source, Capacity to_sink) {
  node(n).terminal += from_source - to_sink;
}

void MaxFlow::add_edge(int from, int to, Capacity forth, Capacity back) {
  const auto index = static_cast<Arc>(arcs_.size());
  arcs_.push_back({to, node(from).first, forth});
  arcs_.push_back({from, node(to).first, back});
  node(from).first = index;
  node(to).first = index + 1;
}

void MaxFlow::activate(std::int32_t n) {
  if (node(n).queued) return;
  node(n).queued = true;
  active_.push_back(n);
}

void MaxFlow::solve() {
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    Node& one = nodes_[n];
    if (one.terminal == 0) continue;
    one.tree = one.terminal > 0 ? Tree::kSource : Tree::kSink;
    one.parent = kTerminal;
    one.depth = 1;
    activate(static_cast<std::int32_t>(n));
  }
  for (Arc meeting = grow(); meeting != kNoArc; meeting = grow()) {
    ++step_;
    augment(meeting);
    adopt_orphans();
  }
}

MaxFlow::Arc MaxFlow::grow() {
  while (next_active_ < active_.size()) {
    const std::int32_t n = active_[next_active_];
    const Tree tree = node(n).tree;
    if (tree != Tree::kNone) {
      for (Arc a = node(n).first; a != kNoArc; a = arc(a).next) {
        if (left_along(tree, a) == 0) continue;
        const std::int32_t other = arc(a).head;
        Node& neighbour = node(other);
        if (neighbour.tree == Tree::kNone) {
          neighbour.tree = tree;
          neighbour.parent = a ^ 1;
          neighbour.depth = node(n).depth + 1;
          neighbour.checked = node(n).checked;
          activate(other);
        } else if (neighbour.tree != tree) {
          return tree == Tree::kSource ? a : a ^ 1;  // n stays active: it may have more such neighbours
        }
      }
    }
    node(n).queued = false;
    if (++next_active_ > 4096 && 2 * next_active_ > active_.size()) {
      active_.erase(active_.begin(), active_.begin() + static_cast<std::ptrdiff_t>(next_active_));
      next_active_ = 0;
    }
  }
  return kNoArc;
}

void MaxFlow::augment(Arc meeting) {
  const std::int32_t in_source = arc(meeting ^ 1).head;
  const std::int32_t in_sink = arc(meeting).head;
  Capacity least = arc(meeting).left;
  std::int32_t n = in_source;
  for (; node(n).parent != kTerminal; n = arc(node(n).parent).head)
    least = std::min(least, arc(node(n).parent ^ 1).left);
  least = std::min(least, node(n).terminal);
  for (n = in_sink; node(n).parent != kTerminal; n = arc(node(n).parent).head) {
    least = std::min(least, arc(node(n).parent).left);
  }
  least = std::min(least, -node(n).terminal);

  const auto orphan = [this](std::int32_t which) {
    node(which).parent = kNoArc;
    orphans_.push_back(which);
  };
  const auto push = [&](std::int32_t begin, int toward_root) {
    std::int32_t at = begin;
    while (node(at).parent != kTerminal) {
      const Arc up = node(at).parent;
      const std::int32_t parent = arc(up).head;
      const Arc forward = toward_root > 0 ? up : up ^ 1;
      arc(forward).left -= least;
      arc(forward ^ 1).left += least;
      if (arc(forward).left == 0) orphan(at);
      at = parent;
    }
    node(at).terminal += toward_root > 0 ? least : -least;
    if (node(at).terminal == 0) orphan(at);
  };
  arc(meeting).left -= least;
  arc(meeting ^ 1).left += least;
  push(in_source, -1);
  push(in_sink, 1);
}

void MaxFlow::adopt_orphans() {
  while (!orphans_.empty()) {
    const std::int32_t n = orphans_.back();
    orphans_.pop_back();
    adopt(n);
  }
}

bool MaxFlow::rooted(std::int32_t n) {
  std::int32_t depth = 0;
  std::int32_t at = n;
  while (node(at).checked != step_) {
    const Arc up = node(at).parent;
    if (up == kNoArc) return false;
    ++depth;
    if (up == kTerminal) {
      node(at).checked = step_;
      node(at).depth = 1;
      --depth;
      break;
    }
    at = arc(up).head;
  }
  depth += node(at).depth;
  for (at = n; node(at).checked != step_; at = arc(node(at).parent).head) {
    node(at).checked = step_;
    node(at).depth = depth--;
  }
  return true;
}

void MaxFlow::adopt(std::int32_t orphan) {
  const Tree tree = node(orphan).tree;
  Arc best = kNoArc;
  std::int32_t best_depth = std::numeric_limits<std::int32_t>::max();
  for (Arc a = node(orphan).first; a != kNoArc; a = arc(a).next) {
    // The flow passes the parent first in the source's tree, the child first in the sink's.
    if (left_along(tree, a ^ 1) == 0) continue;
    const std::int32_t other = arc(a).head;
    if (node(other).tree != tree || node(other).parent == kNoArc || !rooted(other)) continue;
    if (node(other).depth < best_depth) {
      best = a;
      best_depth = node(other).depth;
    }
  }
  Node& lost = node(orphan);
  lost.parent = best;
  if (best != kNoArc) {
    lost.checked = step_;
    lost.depth = best_depth + 1;
    return;
  }
  for (Arc a = lost.first; a != kNoArc; a = arc(a).next) {
    const std::int32_t other = arc(a).head;
    if (node(other).tree != tree) continue;
    if (left_along(tree, a ^ 1) > 0) activate(other);  // may reach the orphan again
    const Arc up = node(other).parent;
    if (up >= 0 && arc(up).head == orphan) {
      node(other).parent = kNoArc;
      orphans_.push_back(other);
    }
  }
  lost.tree = Tree::kNone;
}

}  // namespace nodal::seams
