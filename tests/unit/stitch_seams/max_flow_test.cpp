// The minimum cut against all cuts of small graphs, and against a maximum flow found in another way on larger ones.
#include "stitch/seams/max_flow.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <queue>
#include <random>

namespace nodal::seams {
namespace {

struct Edge {
  int from, to;
  std::int64_t forth, back;
};
struct Graph {
  int nodes = 0;
  std::vector<std::int64_t> from_source, to_sink;
  std::vector<Edge> edges;

  std::int64_t cost(const std::vector<bool>& with_source) const {
    std::int64_t sum = 0;
    for (std::size_t n = 0; n < with_source.size(); ++n) sum += with_source[n] ? to_sink[n] : from_source[n];
    for (const Edge& edge : edges) {
      const bool a = with_source[static_cast<std::size_t>(edge.from)],
                 b = with_source[static_cast<std::size_t>(edge.to)];
      if (a && !b) sum += edge.forth;
      if (b && !a) sum += edge.back;
    }
    return sum;
  }
  std::vector<bool> cut() const {
    MaxFlow flow(nodes);
    for (int n = 0; n < nodes; ++n) {
      flow.add_terminals(n, from_source[static_cast<std::size_t>(n)], to_sink[static_cast<std::size_t>(n)]);
    }
    for (const Edge& edge : edges) flow.add_edge(edge.from, edge.to, edge.forth, edge.back);
    flow.solve();
    std::vector<bool> sides;
    for (int n = 0; n < nodes; ++n) sides.push_back(flow.with_source(n));
    return sides;
  }
};

Graph random_graph(int nodes, int edges, std::mt19937& random, int largest) {
  std::uniform_int_distribution<int> capacity(0, largest), which(0, nodes - 1);
  Graph graph;
  graph.nodes = nodes;
  for (int n = 0; n < nodes; ++n) {
    graph.from_source.push_back(random() % 2 == 0 ? capacity(random) : 0);
    graph.to_sink.push_back(random() % 2 == 0 ? capacity(random) : 0);
  }
  for (int e = 0; e < edges; ++e) {
    const int a = which(random), b = which(random);
    if (a != b) graph.edges.push_back({a, b, capacity(random), random() % 3 == 0 ? 0 : capacity(random)});
  }
  return graph;
}

Graph random_grid(int side, std::mt19937& random) {
  Graph graph = random_graph(side * side, 0, random, 30);
  std::uniform_int_distribution<int> capacity(0, 20);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      if (x + 1 < side) graph.edges.push_back({y * side + x, y * side + x + 1, capacity(random), capacity(random)});
      if (y + 1 < side) graph.edges.push_back({y * side + x, (y + 1) * side + x, capacity(random), capacity(random)});
    }
  }
  return graph;
}

/// The maximum flow by shortest augmenting paths in a matrix of capacities (Edmonds and Karp).
std::int64_t maximum_flow(const Graph& graph) {
  const auto n = static_cast<std::size_t>(graph.nodes) + 2;
  const std::size_t source = n - 2, sink = n - 1;
  std::vector<std::vector<std::int64_t>> left(n, std::vector<std::int64_t>(n));
  for (std::size_t k = 0; k + 2 < n; ++k) {
    left[source][k] += graph.from_source[k];
    left[k][sink] += graph.to_sink[k];
  }
  for (const Edge& edge : graph.edges) {
    left[static_cast<std::size_t>(edge.from)][static_cast<std::size_t>(edge.to)] += edge.forth;
    left[static_cast<std::size_t>(edge.to)][static_cast<std::size_t>(edge.from)] += edge.back;
  }
  std::int64_t flow = 0;
  while (true) {
    std::vector<std::size_t> parent(n, n);
    parent[source] = source;
    std::queue<std::size_t> queue;
    queue.push(source);
    while (!queue.empty() && parent[sink] == n) {
      const std::size_t at = queue.front();
      queue.pop();
      for (std::size_t k = 0; k < n; ++k) {
        if (left[at][k] > 0 && parent[k] == n) {
          parent[k] = at;
          queue.push(k);
        }
      }
    }
    if (parent[sink] == n) return flow;
    std::int64_t least = std::numeric_limits<std::int64_t>::max();
    for (std::size_t k = sink; k != source; k = parent[k]) least = std::min(least, left[parent[k]][k]);
    for (std::size_t k = sink; k != source; k = parent[k]) {
      left[parent[k]][k] -= least;
      left[k][parent[k]] += least;
    }
    flow += least;
  }
}

TEST(MaxFlow, SmallGraphs_NoCutIsCheaper) {
  std::mt19937 random(1);
  for (int trial = 0; trial < 2000; ++trial) {
    const int nodes = 1 + static_cast<int>(random() % 8);
    const Graph graph = random_graph(nodes, static_cast<int>(random() % 20), random, trial % 3 == 0 ? 2 : 15);
    std::int64_t least = std::numeric_limits<std::int64_t>::max();
    for (unsigned sides = 0; sides < (1U << nodes); ++sides) {
      std::vector<bool> cut;
      for (int n = 0; n < nodes; ++n) cut.push_back((sides >> n & 1) != 0);
      least = std::min(least, graph.cost(cut));
    }
    ASSERT_EQ(graph.cost(graph.cut()), least) << "graph " << trial;
  }
}

TEST(MaxFlow, Grids_TheCutIsTheMaximumFlow) {
  std::mt19937 random(2);
  for (int trial = 0; trial < 40; ++trial) {
    const Graph graph = random_grid(8, random);
    ASSERT_EQ(graph.cost(graph.cut()), maximum_flow(graph)) << "grid " << trial;
  }
}

TEST(MaxFlow, NodesThatEitherSideMayHave_AreTheSources) {
  MaxFlow flow(3);
  flow.add_terminals(0, 5, 0);
  flow.add_edge(0, 1, 2, 2);
  flow.add_edge(1, 2, 2, 2);
  flow.add_terminals(2, 0, 5);
  flow.solve();
  EXPECT_TRUE(flow.with_source(0));
  EXPECT_TRUE(flow.with_source(1)) << "both of its edges are full";
  EXPECT_FALSE(flow.with_source(2));
}

}  // namespace
}  // namespace nodal::seams
