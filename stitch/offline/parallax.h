// Takes away the parallax between heads: each head's picture is moved, where others see the same, to where a point
// between the heads would see it.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "protocol/base/image.h"
#include "stitch/offline/flow.h"
#include "stitch/offline/head_picture.h"
#include "stitch/parallel/workers.h"

namespace nodal::offline {

/// A part of the sphere around the great circle in the middle between two directions, as a cylinder's rows and columns.
///
/// Threading: a value.
class OverlapChart {
 public:
  /// `columns`: of the whole circle.
  OverlapChart(const Eigen::Vector3d& a, const Eigen::Vector3d& b, int columns);

  int columns() const { return columns_; }
  int rows() const { return rows_; }
  Eigen::Vector3d ray(double u, double v) const;
  /// The position of a ray; v may be outside 0 .. rows().
  void place(const Eigen::Vector3d& ray, double& u, double& v) const;
  double radians_per_pixel() const { return pitch_; }

  /// A part of the chart, as what can be compared without angles.
  struct Part {
    double least_up = -1, most_up = 1;  ///< sines
    Eigen::Vector2d middle{1, 0};       ///< along the circle
    double least_along = -2;            ///< cosine
  };
  Part part(int left, int top, int width, int height) const;
  /// False only for rays outside of the part.
  bool may_be_in(const Part& part, const Eigen::Vector3d& ray) const;

 private:
  int columns_, rows_;
  double pitch_;
  Eigen::Matrix3d axes_;  ///< rows: the middle, along the circle, from the circle towards b
};

/// The flow between all heads whose views overlap.
///
/// At a ray, let w be the heads' scores (Sighting::score) divided by their sum. A head's picture is sampled along the
/// ray, moved by the sum over the other heads of w times the flow to them. Where one head has all the weight it is not
/// moved, so that nothing jumps at the edge of an overlap.
///
/// Threading: immutable; any thread.
/// Ownership: keeps the heads by reference.
class Parallax {
 public:
  /// `columns`: of the charts, on the whole circle. A missing head (without data) has no flow.
  Parallax(const std::vector<HeadView>& heads, std::span<const ImageView> pictures, int columns,
           const parallel::Workers& workers);

  /// The ray along which a head's picture is sampled for a ray of the result.
  Eigen::Vector3d moved(std::size_t head, const Eigen::Vector3d& ray) const;

 private:
  struct Overlap {
    std::size_t a, b;
    OverlapChart chart;
    int left = 0, top = 0;  ///< place of the flow's first pixel in the chart
    Flow flow;
    OverlapChart::Part part{};  ///< where the flow is
  };
  void find(Overlap& overlap, std::span<const HeadPicture* const> pictures) const;

  const std::vector<HeadView>& heads_;
  std::vector<Overlap> overlaps_;
  std::vector<std::vector<std::size_t>> of_head_;  ///< overlaps of each head
};

}  // namespace nodal::offline
