// The places on the heads' pictures that make a raymap sample, in double precision: the fixed-point table is a
// rounding of it, and is compared with it.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
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
#include "stitch/table/encoded_gain.h"
#include "stitch/table/options.h"
#include "stitch/table/ray_interpolation.h"
#include "stitch/table/tabled_lens.h"

namespace nodal::table {

/// One head's share of one raymap sample. Bilinear between samples floor(x), floor(y) and the next ones of the
/// head's component plane, whose sample (i, j) is at (i, j) here; 0 <= x <= width - 1.
struct RaySample {
  HeadIndex head = 0;
  double x = 0;
  double y = 0;
  double weight = 0;  ///< > 0; those of one raymap sample sum to 1
  double gain = 1;    ///< undoes the vignetting there, in encoded values about black
};

/// A calibration, a layout and formats, made ready to be sampled.
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
    int component = 0;  ///< the first that has it
    int width = 0;
    int height = 0;
    PlaneGrid on_raymap;
  };
  /// A head's component plane, or that of the field of it that the options ask for.
  struct Plane {
    int width = 0;
    int height = 0;
    PlaneGrid on_picture;
    /// Up to this distance from the lens's centre, px with the aspect taken out, ray interpolation moves no place by
    /// more than kSamePlace.
    double same_radius = 0;
  };
  /// In samples: a sixteenth of the tolerance of a tile's fit.
  static constexpr double kSamePlace = 1.0 / 1024;
  /// Values computed once per head.
  struct Optics {
    TabledLens lens;
    Eigen::Vector3d right, down, axis;  ///< of the head, in the rig: the rows of R_head_rig
    double cos_reach = -1;              ///< no ray whose cosine with the axis is less is inside the region
    double depth_per_px = 1;  ///< 1 over the distance from an edge of the region where the weight has its full value
    EncodedGain undo;
    std::array<double, 3> gain{1, 1, 1};  ///< undoes the head's own gain, by ComponentRule::gain_row
  };

  PixelFormat raymap_format() const { return raymap_format_; }
  const geometry::RaymapLayout& layout() const { return *layout_; }
  const TableOptions& options() const { return options_; }
  /// Of raymaps of linear light, linear_power(): gains act on light^(1 / power).
  double power() const { return power_; }
  std::span<const PixelFormat> head_formats() const { return head_formats_; }
  std::span<const geometry::Head> heads() const { return heads_; }
  std::span<const Optics> optics() const { return optics_; }
  std::span<const Grid> grids() const { return grids_; }
  const Plane& plane(int grid, HeadIndex head) const { return planes_[static_cast<std::size_t>(grid)][head]; }
  /// That of sample (x, y) of a grid; nothing where the layout holds none.
  std::optional<geometry::Ray> ray(int grid, int x, int y) const;

 private:
  RaySampler() = default;

  const geometry::RaymapLayout* layout_ = nullptr;
  PixelFormat raymap_format_ = PixelFormat::kRgb24;
  TableOptions options_;
  double power_ = 1;
  std::vector<PixelFormat> head_formats_;
  std::vector<geometry::Head> heads_;
  std::vector<Optics> optics_;
  std::vector<Grid> grids_;
  std::vector<std::array<Plane, kMaxHeads>> planes_;  ///< by grid, then head
};

/// Samples the raymap row by row, and remembers the rays of source samples that neighbouring rows share.
///
/// Threading: thread-bound; one a thread.
/// Ownership: keeps the sampler by reference.
class RowSampler {
 public:
  explicit RowSampler(const RaySampler& sampler) : rig_(sampler) {}

  /// Computes row y of a grid, which at() then returns.
  void sample(int grid, int y);
  /// The same for any samples, by GridTable::place(); at(k) is then that of the k-th, and nothing for kNowhere.
  void sample(int grid, std::span<const std::uint32_t> places);
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
  /// A head that sees the ray in hand.
  struct Sight {
    HeadIndex head = 0;
    geometry::Pixel pixel;
    double weight = 0;
  };
  void begin(int grid);
  void add(const std::optional<geometry::Ray>& ray);
  int find_sights(const geometry::Ray& ray, std::array<Sight, kMaxHeads>& sights) const;
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
