#include "stitch/table/ray_sampler.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "protocol/base/try.h"
#include "stitch/table/head_weight.h"
#include "stitch/table/ray_interpolation.h"
#include "stitch/table/tone_compiler.h"

namespace nodal::table {
namespace {

constexpr int kSmallestHead = 4;  // px; chroma of half size then has at least two samples per side
constexpr double kUnknown = std::numeric_limits<double>::infinity();

Status check_formats(const Calibration& calibration, PixelFormat raymap_format,
                     std::span<const PixelFormat> head_formats, bool fields) {
  if (!is_raymap_format(raymap_format)) {
    return fail(Errc::kUnsupported, "a raymap of " + std::string(pixel_format_name(raymap_format)) +
                                        " cannot be blended; ask for I420, NV12, RGB24, GREY, RGB48 or GREY16");
  }
  if (head_formats.size() != calibration.heads.size()) {
    return fail(Errc::kHeadMismatch,
                fmt::format("the calibration has {} heads, but the rig has {}; upload the calibration of this rig",
                            calibration.heads.size(), head_formats.size()));
  }
  if (head_formats.size() > static_cast<std::size_t>(kMaxHeads)) {
    return fail(Errc::kTooLarge, fmt::format("the calibration has {} heads; a blend table is for up to {}",
                                             head_formats.size(), kMaxHeads));
  }
  for (std::size_t h = 0; h < head_formats.size(); ++h) {
    const HeadCalibration& head = calibration.heads[h];
    if (blended_format(head_formats[h], raymap_format) != head_formats[h]) {
      return fail(Errc::kUnsupported,
                  "head '" + head.name + "': its " + std::string(pixel_format_name(head_formats[h])) +
                      " pictures cannot be blended into a raymap of " + std::string(pixel_format_name(raymap_format)) +
                      "; GREY heads make GREY and GREY16, RGB24 make RGB24 and RGB48, and I420, NV12, I422, YUYV and "
                      "UYVY make I420 and NV12 (decode MJPEG and Bayer pictures first)");
    }
    if (head.width < kSmallestHead || head.height < kSmallestHead || head.width > 65535 || head.height > 65535) {
      return fail(Errc::kBadValue, fmt::format("head '{}': pictures of {} x {} px; each side must be 4 to 65535",
                                               head.name, head.width, head.height));
    }
    const int rows = component_grid(head_formats[h], component_count(head_formats[h]) - 1).step_y == 2 ? 4 : 2;
    if (fields && (head.height % rows != 0 || head.height < 2 * kSmallestHead)) {
      return fail(Errc::kUnsupported, fmt::format("head '{}': frames of {} rows cannot be taken apart into fields; in "
                                                  "{} they have a multiple of {}, 8 at least",
                                                  head.name, head.height, pixel_format_name(head_formats[h]), rows));
    }
  }
  return {};
}

/// Written so that NaN is refused.
Status check_transition(const TableOptions& options) {
  if (!(options.seam_width_deg >= 0 && options.seam_width_deg <= kWidestSeamDeg)) {
    return fail(Errc::kBadValue, fmt::format("a seam of {:f} degrees; its width must be 0 to {} degrees",
                                             options.seam_width_deg, static_cast<int>(kWidestSeamDeg)));
  }
  if (!(options.feather > 0 && options.feather <= 1)) {
    return fail(Errc::kBadValue, fmt::format("a feather of {:f}; it must be above 0, up to 1", options.feather));
  }
  return {};
}

/// The distance, in samples, by which ray interpolation moves the position `at`, whose fractions between its four
/// samples are `place`.
double moved_by_rays(const geometry::Head& head, const PlaneGrid& plane_grid, geometry::Pixel at, Fractions place) {
  const std::optional<geometry::Ray> ray = head.unproject(at);
  if (!ray) return kUnknown;
  std::array<Eigen::Vector3d, 4> neighbours;
  for (std::size_t k = 0; k < 4; ++k) {
    const std::optional<geometry::Ray> neighbour =
        head.unproject({at.x + (static_cast<double>(k & 1) - place.x) * plane_grid.step_x,
                        at.y + (static_cast<double>(k >> 1) - place.y) * plane_grid.step_y});
    if (!neighbour) return kUnknown;
    neighbours[k] = neighbour->direction();
  }
  const Fractions moved = ray_fractions(TangentPlane(ray->direction()), neighbours, place);
  return std::max(std::abs(moved.x - place.x), std::abs(moved.y - place.y));
}

/// RaySampler::Plane::same_radius. A lens's effect depends on the radius and on the angle between it and the rows.
double same_radius(const geometry::Head& head, const PlaneGrid& plane_grid) {
  constexpr int kRadii = 48;
  const HeadCalibration& c = head.calibration();
  double radius = 0;
  for (int k = 1; k <= kRadii; ++k) {
    const double next = radius_of_region(head) * k / kRadii;
    for (const double turn : {0.0, 0.4, 0.8, 1.2, 1.5707}) {
      const geometry::Pixel at{c.center_x + next * std::cos(turn), c.center_y + c.aspect * next * std::sin(turn)};
      for (const Fractions place : {Fractions{0.5, 0}, Fractions{0, 0.5}, Fractions{0.5, 0.5}}) {
        if (!(moved_by_rays(head, plane_grid, at, place) < RaySampler::kSamePlace)) return radius;
      }
    }
    radius = next;
  }
  return radius;
}

}  // namespace

Result<RaySampler> RaySampler::make(const Calibration& calibration, const geometry::RaymapLayout& layout,
                                    PixelFormat raymap_format, std::span<const PixelFormat> head_formats,
                                    const TableOptions& options) {
  NODAL_TRY(check_transition(options));
  NODAL_TRY(check_formats(calibration, raymap_format, head_formats, options.field.has_value()));
  NODAL_TRY_ASSIGN(std::vector<geometry::Head> heads, geometry::make_heads(calibration));

  RaySampler sampler;
  sampler.layout_ = &layout;
  sampler.raymap_format_ = raymap_format;
  sampler.options_ = options;
  sampler.power_ = linear_power(calibration);
  sampler.head_formats_.assign(head_formats.begin(), head_formats.end());
  sampler.heads_ = std::move(heads);
  for (const geometry::Head& head : sampler.heads_) {
    sampler.optics_.push_back(HeadOptics::of(head, raymap_format, sampler.power_, options));
    const bool seams = options.transition != Transition::kFeather;
    sampler.steepest_.push_back(seams ? head.magnification() * steepest_score(head, sampler.optics_.back()) : 0);
  }
  const auto* nowhere = static_cast<const std::uint8_t*>(nullptr);
  const ImageView raymap = packed_image(raymap_format, layout.width(), layout.height(), nowhere);
  const int grids = has_chroma(raymap_format) ? 2 : 1;
  for (int g = 0; g < grids; ++g) {
    const auto c = static_cast<std::size_t>(g);  // component 1 is the first of the chroma grid
    sampler.grids_.push_back({g, raymap.planes[c].width, raymap.planes[c].height, component_grid(raymap_format, g)});
    std::array<Plane, kMaxHeads> planes;
    for (std::size_t h = 0; h < sampler.heads_.size(); ++h) {
      const geometry::Head& head = sampler.heads_[h];
      const int rows = options.field ? head.height() / 2 : head.height();
      const ImageView picture = halved_chroma(packed_image(head_formats[h], head.width(), rows, nowhere));
      const PlaneView& plane = picture.planes[c];
      const PlaneGrid plane_grid =
          options.field ? field_grid(head_formats[h], g, *options.field) : component_grid(head_formats[h], g);
      planes[h] = {plane.width, plane.height, halved_chroma_grid(head_formats[h], g, plane_grid)};
      planes[h].same_radius = same_radius(head, planes[h].on_picture);
    }
    sampler.planes_.push_back(planes);
  }
  return sampler;
}

geometry::Pixel RaySampler::on_raymap(int grid, double x, double y) const {
  const PlaneGrid& plane_grid = grids_[static_cast<std::size_t>(grid)].on_raymap;
  return {std::min<double>(layout_->width(), (x + 0.5 - plane_grid.offset_x) * plane_grid.step_x),
          std::min<double>(layout_->height(), (y + 0.5 - plane_grid.offset_y) * plane_grid.step_y)};
}

std::optional<geometry::Ray> RaySampler::ray(int grid, double x, double y) const {
  const geometry::Pixel at = on_raymap(grid, x, y);
  return layout_->ray(at.x, at.y);
}

std::optional<HeadSight> RaySampler::sight(HeadIndex head, const geometry::Ray& ray) const {
  const Optics& optics = optics_[head];
  const Eigen::Vector3d d = heads_[head].seen_from_here(ray.direction());
  const double ahead = optics.axis.dot(d);  // the cosine with the head's axis
  if (ahead < optics.cos_reach) return std::nullopt;
  const Eigen::Vector3d in_head(optics.right.dot(d), optics.down.dot(d), ahead);
  const std::optional<HeadSight> seen = see(heads_[head], optics.lens, in_head, optics.depth_per_px);
  return seen && seen->inside >= kEdge ? seen : std::nullopt;
}

Eigen::Vector2d RaySampler::score_slope(HeadIndex head, const geometry::Ray& ray, double score) const {
  // One-sided differences. Their relative error is about kStep, their rounding noise about 1e-16 / kStep.
  constexpr double kStep = 1e-7;  // rad; the vector's length is then 1 to within kStep squared
  const Eigen::Vector3d across = ray.direction().unitOrthogonal();
  const std::array<Eigen::Vector3d, 2> tangents{across, ray.direction().cross(across)};
  const Optics& optics = optics_[head];
  Eigen::Vector2d slope;
  for (int way = 0; way < 2; ++way) {
    const Eigen::Vector3d d =
        heads_[head].seen_from_here(ray.direction() + kStep * tangents[static_cast<std::size_t>(way)]);
    const std::optional<HeadSight> seen = see(
        heads_[head], optics.lens, {optics.right.dot(d), optics.down.dot(d), optics.axis.dot(d)}, optics.depth_per_px);
    slope[way] = ((seen ? score_of(*seen, optics.depth_per_px) : 0.0) - score) / kStep;
  }
  return slope;
}

RaySample RaySampler::place(int grid, HeadIndex head, geometry::Pixel pixel) const {
  const Plane& picture = plane(grid, head);
  const PlaneGrid& plane_grid = picture.on_picture;
  // Within half a sample of the picture's edge there is no next sample: the position is clamped to the edge sample.
  RaySample sample{head, std::clamp(pixel.x / plane_grid.step_x + plane_grid.offset_x - 0.5, 0.0, picture.width - 1.0),
                   std::clamp(pixel.y / plane_grid.step_y + plane_grid.offset_y - 0.5, 0.0, picture.height - 1.0), 0,
                   1};
  if (options_.undo_vignetting) sample.gain = optics_[head].undo.undo(heads_[head].vignetting(pixel));
  return sample;
}

bool RaySampler::stays(int grid, HeadIndex head, geometry::Pixel pixel) const {
  if (options_.interpolation == Interpolation::kPixel) return true;
  const HeadCalibration& c = heads_[head].calibration();
  const double across = pixel.x - c.center_x;
  const double down = (pixel.y - c.center_y) / c.aspect;
  const double radius = plane(grid, head).same_radius;
  return across * across + down * down < radius * radius;
}

}  // namespace nodal::table
