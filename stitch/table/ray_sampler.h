// The positions in the heads' pictures and the weights that make a raymap sample, in double precision. The fixed-point
// table is this, rounded; tests compare the two.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "protocol/base/field.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"
#include "protocol/calibration.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/ray.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/table/head_optics.h"
#include "stitch/table/head_sight.h"
#include "stitch/table/options.h"
#include "stitch/table/ray_interpolation.h"

namespace nodal::table {

/// One head's share of one raymap sample: the bilinear mean of samples floor(x), floor(y) and the next ones of the
/// head's component plane. Here sample (i, j) is at position (i, j), not at (i+½, j+½); 0 <= x <= width - 1.
struct RaySample {
  HeadIndex head = 0;
  double x = 0;
  double y = 0;
  double weight = 0;  ///< > 0; the weights of one raymap sample sum to 1
  double gain = 1;    ///< undoes the vignetting there; multiplies encoded values, less black
};

/// A calibration, a layout and formats, prepared for sampling.
///
/// Threading: immutable after make(); any thread.
/// Ownership: keeps the layout by reference.
class RaySampler {
 public:
  /// Errors: see compile_blend_table.
  static Result<RaySampler> make(const Calibration& calibration, const geometry::RaymapLayout& layout,
                                 PixelFormat raymap_format, std::span<const PixelFormat> head_formats,
                                 const TableOptions& options);

  /// A sample grid of the raymap: 0 is full resolution, 1 the chroma of I420 and NV12.
  struct Grid {
    int component = 0;  ///< the first component on this grid
    int width = 0;
    int height = 0;
    PlaneGrid on_raymap;
  };
  /// A head's component plane; if the options ask for a field, the field's plane.
  struct Plane {
    int width = 0;
    int height = 0;
    PlaneGrid on_picture;
    /// Up to this distance from the lens's centre (px, rows divided by the aspect), ray interpolation moves no position
    /// by more than kSamePlace.
    double same_radius = 0;
  };
  /// In samples: a sixteenth of the tolerance of a tile's fit.
  static constexpr double kSamePlace = 1.0 / 1024;
  using Optics = HeadOptics;

  PixelFormat raymap_format() const { return raymap_format_; }
  const geometry::RaymapLayout& layout() const { return *layout_; }
  const TableOptions& options() const { return options_; }
  /// For raymaps of linear light: linear_power(); gains act on light^(1 / power).
  double power() const { return power_; }
  std::span<const PixelFormat> head_formats() const { return head_formats_; }
  std::span<const geometry::Head> heads() const { return heads_; }
  std::span<const Optics> optics() const { return optics_; }
  /// steepest_score() of the head, per radian between rays of the rig; 0 without seams.
  double steepest(HeadIndex head) const { return steepest_[head]; }
  std::span<const Grid> grids() const { return grids_; }
  const Plane& plane(int grid, HeadIndex head) const { return planes_[static_cast<std::size_t>(grid)][head]; }
  /// Where on the raymap sample (x, y) of a grid is, or a point between samples.
  geometry::Pixel on_raymap(int grid, double x, double y) const;
  /// The ray there; nothing where the layout has none.
  std::optional<geometry::Ray> ray(int grid, double x, double y) const;
  /// What a head sees of a ray; nothing outside its region.
  std::optional<HeadSight> sight(HeadIndex head, const geometry::Ray& ray) const;
  /// The slope of a head's score (score_of()) along two directions across the ray, per radian. `score`: at the ray.
  Eigen::Vector2d score_slope(HeadIndex head, const geometry::Ray& ray, double score) const;
  /// The position and the gain of a pixel of a head's picture, by pixel interpolation. Positions outside the picture's
  /// outermost samples are moved to them.
  RaySample place(int grid, HeadIndex head, geometry::Pixel pixel) const;
  /// Whether ray interpolation leaves a pixel's position as place() has it, to within kSamePlace; always true for
  /// pixel interpolation.
  bool stays(int grid, HeadIndex head, geometry::Pixel pixel) const;

 private:
  RaySampler() = default;

  const geometry::RaymapLayout* layout_ = nullptr;
  PixelFormat raymap_format_ = PixelFormat::kRgb24;
  TableOptions options_;
  double power_ = 1;
  std::vector<PixelFormat> head_formats_;
  std::vector<geometry::Head> heads_;
  std::vector<Optics> optics_;
  std::vector<double> steepest_;
  std::vector<Grid> grids_;
  std::vector<std::array<Plane, kMaxHeads>> planes_;  ///< by grid, then head
};

/// Samples the raymap row by row, and caches the rays of source samples that neighbouring rows share.
///
/// Threading: thread-bound; one per thread.
/// Ownership: keeps the sampler by reference.
class RowSampler {
 public:
  explicit RowSampler(const RaySampler& sampler) : rig_(sampler) {}

  /// Computes row y of a grid, which at() then returns.
  void sample(int grid, int y);
  /// The same for any list of samples, given by GridTable::place(); at(k) then returns the sources of the k-th, none
  /// for kNowhere.
  void sample(int grid, std::span<const std::uint32_t> places);
  /// The same for any rays.
  void sample(int grid, std::span<const std::optional<geometry::Ray>> rays);
  int width() const { return static_cast<int>(ends_.size()); }
  /// The sources of sample x of the row; empty where no head sees its ray.
  std::span<const RaySample> at(int x) const;

 private:
  struct CachedRay {
    std::int32_t x = -1;
    std::int32_t y = -1;
    bool exists = false;
    Eigen::Vector3d direction;
  };
  /// A head that sees the current ray.
  struct Sight {
    HeadIndex head = 0;
    geometry::Pixel pixel;
    double weight = 0;
  };
  void begin(int grid);
  void add(const std::optional<geometry::Ray>& ray);
  int find_sights(const geometry::Ray& ray, std::array<Sight, kMaxHeads>& sights) const;
  bool is_clear(std::span<Sight> sights) const;
  void choose_best(const geometry::Ray& ray, std::span<Sight> sights) const;
  RaySample place(const Sight& sight, const geometry::Ray& ray);
  const CachedRay& ray_of(HeadIndex head, std::int32_t x, std::int32_t y);
  std::optional<Eigen::Vector3d> unproject(HeadIndex head, geometry::Pixel pixel) const;

  const RaySampler& rig_;
  int grid_ = -1;
  std::vector<std::uint32_t> ends_;
  std::vector<RaySample> samples_;
  std::array<std::vector<CachedRay>, kMaxHeads> rays_;
};

}  // namespace nodal::table
