#include "stitch/solve/pieces.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <string>
#include <thread>

#include "problems.h"

namespace nodal::solve {
namespace {

/// Distributes the work over `threads` threads, the last pieces first.
ForEach on_threads(int threads) {
  return [threads](int count, const std::function<void(int)>& work) {
    std::atomic<int> left{count};
    std::vector<std::thread> all;
    for (int t = 0; t < threads; ++t) {
      all.emplace_back([&] {
        for (int i = left.fetch_sub(1) - 1; i >= 0; i = left.fetch_sub(1) - 1) work(i);
      });
    }
    for (std::thread& thread : all) thread.join();
  };
}

/// A decay fitted to 4000 values of very different sizes, so that the order of a sum affects its last bits.
Evaluation decay(const Eigen::VectorXd& x, const ForEach& for_each) {
  constexpr int kPieces = 24, kEach = 167;
  return sum_of_pieces(kPieces, Evaluation{NormalEquations(2)}, for_each, [&](int piece, Evaluation& sum) {
    for (int i = piece * kEach; i < (piece + 1) * kEach; ++i) {
      const double t = 0.002 * i, e = std::exp(-x[1] * t), weight = std::pow(10, i % 7 - 3);
      const Eigen::Vector2d row(e, -x[0] * t * e);
      const double residual = x[0] * e - (3 * std::exp(-0.7 * t) + 0.1 * std::sin(1.7 * i));
      sum.equations.add(row.data(), residual, weight);
      sum.cost += weight * residual * residual;
    }
  });
}

Eigen::VectorXd fitted(const ForEach& for_each) {
  return descend(Eigen::VectorXd(Eigen::Vector2d(1, 1)), [&](const Eigen::VectorXd& x) { return decay(x, for_each); },
                 problems::sum_of, {}, {.enough = 1e-14})
      .state;
}

TEST(Pieces, OneThreadOrMany_DescendToTheSameBits) {
  const Eigen::VectorXd alone = fitted(one_by_one);
  EXPECT_NEAR(alone[0], 3, 0.1);
  EXPECT_NEAR(alone[1], 0.7, 0.05);
  for (const int threads : {1, 2, 3, 7, 16}) EXPECT_EQ(fitted(on_threads(threads)), alone) << threads << " threads";
}

TEST(Pieces, AddedInTheirOrder_WhoeverComputesThem) {
  struct Words {
    std::string all;
    void add(const Words& other) { all += other.all; }
  };
  const Words sum = sum_of_pieces(6, Words{}, on_threads(3),
                                  [](int piece, Words& part) { part.all += static_cast<char>('a' + piece); });
  EXPECT_EQ(sum.all, "abcdef");
}

}  // namespace
}  // namespace nodal::solve
