#include "stitch/table/ray_sampler.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "stitch/blend/blend_table.h"
#include "stitch/table/head_sight.h"
#include "stitch/table/ray_interpolation.h"
#include "stitch/table/seam.h"
#include "stitch/table/tone_compiler.h"

namespace nodal::table {
namespace {

constexpr int kSmallestHead = 4;  // px; chroma of half size then has at least two samples per side
/// Keeps the weight of a head above 0 close to its edge, where it may be the only head.
constexpr double kLeastFeather = 1e-6;
constexpr double kLeastDepth = 1e-12;
/// Rays closer than this to a region's edge (px) count as outside, so that the result does not depend on rounding.
constexpr double kEdge = 1e-6;
/// Densities from this on are excluded: at the lens's turning point, which only its outermost ray reaches, the density
/// is infinite.
constexpr double kEndless = 1e30;

Status check_formats(const Calibration& calibration, PixelFormat raymap_format,
                     std::span<const PixelFormat> head_formats, bool fields) {
  if (!is_raymap_format(raymap_format)) {
    return fail(Errc::kUnsupported, "a raymap of " + std::string(pixel_format_name(raymap_format)) +
                                        " cannot be blended; ask for I420, NV12, RGB24, GREY, RGB48 or GREY16");
  }
  if (head_formats.size() != calibration.heads.size()) {
    return fail(Errc::kHeadMismatch, "the calibration has " + std::to_string(calibration.heads.size()) +
                                         " heads, but the rig has " + std::to_string(head_formats.size()) +
                                         "; upload the calibration of this rig");
  }
  if (head_formats.size() > static_cast<std::size_t>(kMaxHeads)) {
    return fail(Errc::kTooLarge, "the calibration has " + std::to_string(head_formats.size()) +
                                     " heads; a blend table is for up to " + std::to_string(kMaxHeads));
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
      return fail(Errc::kBadValue, "head '" + head.name + "': pictures of " + std::to_string(head.width) + " x " +
                                       std::to_string(head.height) + " px; each side must be 4 to 65535");
    }
    const int rows = component_grid(head_formats[h], component_count(head_formats[h]) - 1).step_y == 2 ? 4 : 2;
    if (fields && (head.height % rows != 0 || head.height < 2 * kSmallestHead)) {
      return fail(Errc::kUnsupported, "head '" + head.name + "': frames of " + std::to_string(head.height) +
                                          " rows cannot be taken apart into fields; in " +
                                          std::string(pixel_format_name(head_formats[h])) +
                                          " they have a multiple of " + std::to_string(rows) + ", 8 at least");
    }
  }
  return {};
}

/// Written so that NaN is refused.
Status check_transition(const TableOptions& options) {
  if (!(options.seam_width_deg >= 0 && options.seam_width_deg <= kWidestSeamDeg)) {
    return fail(Errc::kBadValue, "a seam of " + std::to_string(options.seam_width_deg) +
                                     " degrees; its width must be 0 to " +
                                     std::to_string(static_cast<int>(kWidestSeamDeg)) + " degrees");
  }
  if (!(options.feather > 0 && options.feather <= 1)) {
    return fail(Errc::kBadValue, "a feather of " + std::to_string(options.feather) + "; it must be above 0, up to 1");
  }
  return {};
}

/// The factor of the weight that decreases towards the edges of the region.
double fade(const HeadSight& seen, bool seams, double depth_per_px) {
  // Seams need continuous slopes: kLeastDepth is added, because max(depth, kLeastDepth) has a jump in its slope.
  if (seams) return seen.depth + kLeastDepth;
  return std::max(kLeastFeather, smoothstep(seen.inside * depth_per_px));
}

/// The distance, in samples, by which ray interpolation moves the position `at`, whose fractions between its four
/// samples are `place`.
double moved_by_rays(const geometry::Head& head, const PlaneGrid& plane_grid, geometry::Pixel at, Fractions place) {
  const std::optional<geometry::Ray> ray = head.unproject(at);
  if (!ray) return kEndless;
  std::array<Eigen::Vector3d, 4> neighbours;
  for (std::size_t k = 0; k < 4; ++k) {
    const std::optional<geometry::Ray> neighbour =
        head.unproject({at.x + (static_cast<double>(k & 1) - place.x) * plane_grid.step_x,
                        at.y + (static_cast<double>(k >> 1) - place.y) * plane_grid.step_y});
    if (!neighbour) return kEndless;
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
  if (Status checked = check_transition(options); !checked) return fail(checked.error());
  if (Status checked = check_formats(calibration, raymap_format, head_formats, options.field.has_value()); !checked)
    return fail(checked.error());
  Result<std::vector<geometry::Head>> heads = geometry::make_heads(calibration);
  if (!heads) return fail(heads.error());

  RaySampler sampler;
  sampler.layout_ = &layout;
  sampler.raymap_format_ = raymap_format;
  sampler.options_ = options;
  sampler.power_ = linear_power(calibration);
  sampler.head_formats_.assign(head_formats.begin(), head_formats.end());
  sampler.heads_ = std::move(*heads);
  for (const geometry::Head& head : sampler.heads_) {
    sampler.optics_.push_back(HeadOptics::of(head, raymap_format, sampler.power_, options));
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

std::span<const RaySample> RowSampler::at(int x) const {
  const auto i = static_cast<std::size_t>(x);
  const std::uint32_t begin = i == 0 ? 0 : ends_[i - 1];
  return std::span(samples_).subspan(begin, ends_[i] - begin);
}

std::optional<geometry::Ray> RaySampler::ray(int grid, int x, int y) const {
  const PlaneGrid& plane_grid = grids_[static_cast<std::size_t>(grid)].on_raymap;
  return layout_->ray(std::min<double>(layout_->width(), (x + 0.5 - plane_grid.offset_x) * plane_grid.step_x),
                      std::min<double>(layout_->height(), (y + 0.5 - plane_grid.offset_y) * plane_grid.step_y));
}

void RowSampler::sample(int grid, int y) {
  begin(grid);
  const int width = rig_.grids()[static_cast<std::size_t>(grid)].width;
  for (int x = 0; x < width; ++x) add(rig_.ray(grid, x, y));
}

void RowSampler::sample(int grid, std::span<const std::uint32_t> places) {
  begin(grid);
  for (const std::uint32_t place : places) {
    const bool nowhere = place == blend::GridTable::kNowhere;
    add(nowhere ? std::nullopt : rig_.ray(grid, static_cast<int>(place & 0xffff), static_cast<int>(place >> 16)));
  }
}

void RowSampler::sample(int grid, std::span<const std::optional<geometry::Ray>> rays) {
  begin(grid);
  for (const std::optional<geometry::Ray>& ray : rays) add(ray);
}

void RowSampler::begin(int grid) {
  if (grid != grid_) {
    for (auto& rays : rays_) rays.clear();
    grid_ = grid;
  }
  ends_.clear();
  samples_.clear();
}

void RowSampler::add(const std::optional<geometry::Ray>& ray) {
  if (ray) {
    std::array<Sight, kMaxHeads> sights;
    const int count = find_sights(*ray, sights);
    for (int k = 0; k < count; ++k) samples_.push_back(place(sights[static_cast<std::size_t>(k)], *ray));
  }
  ends_.push_back(static_cast<std::uint32_t>(samples_.size()));
}

/// Fills in the heads that see the ray, with weights that sum to 1, and returns their number.
int RowSampler::find_sights(const geometry::Ray& ray, std::array<Sight, kMaxHeads>& sights) const {
  const std::span<const geometry::Head> heads = rig_.heads();
  const bool seams = rig_.options().transition != Transition::kFeather;
  std::size_t count = 0;
  for (std::size_t h = 0; h < heads.size(); ++h) {
    const RaySampler::Optics& optics = rig_.optics()[h];
    const Eigen::Vector3d d = heads[h].seen_from_here(ray.direction());
    const double ahead = optics.axis.dot(d);  // the cosine with the head's axis
    if (ahead < optics.cos_reach) continue;
    const Eigen::Vector3d in_head(optics.right.dot(d), optics.down.dot(d), ahead);
    const std::optional<HeadSight> seen = see(heads[h], optics.lens, in_head, optics.depth_per_px);
    if (!seen || seen->inside < kEdge) continue;
    const double weight = seen->density * fade(*seen, seams, optics.depth_per_px);
    if (!(weight > 0 && weight < kEndless)) continue;
    sights[count++] = {static_cast<HeadIndex>(h), seen->pixel, weight};
  }
  if (seams && count > 1) choose_best(ray, std::span(sights).first(count));
  double sum = 0;
  for (std::size_t k = 0; k < count; ++k) sum += sights[k].weight;
  const double least = sum * rig_.options().least_weight;
  std::size_t kept = 0;
  double kept_sum = 0;
  for (std::size_t k = 0; k < count; ++k) {
    if (!(sights[k].weight > 0) || sights[k].weight < least) continue;
    kept_sum += sights[k].weight;
    sights[kept++] = sights[k];
  }
  const double share = 1 / kept_sum;
  for (std::size_t k = 0; k < kept; ++k) sights[k].weight *= share;
  return static_cast<int>(kept);
}

/// Replaces the weights by those of apply_seam(). Scores are the square roots of the weights: a smoothstep rises with
/// the square of the distance from the edge, so its root is about linear, as apply_seam() needs for seams of the given
/// width.
void RowSampler::choose_best(const geometry::Ray& ray, std::span<Sight> sights) const {
  // One-sided differences. Their relative error is about kStep, their rounding noise about 1e-16 / kStep.
  constexpr double kStep = 1e-7;  // rad; the vector's length is then 1 to within kStep squared
  const Eigen::Vector3d across = ray.direction().unitOrthogonal();
  const std::array<Eigen::Vector3d, 2> tangents{across, ray.direction().cross(across)};
  std::array<SeamCandidate, kMaxHeads> candidates;
  for (std::size_t k = 0; k < sights.size(); ++k) {
    const RaySampler::Optics& optics = rig_.optics()[sights[k].head];
    SeamCandidate& candidate = candidates[k];
    candidate.score = std::sqrt(sights[k].weight);
    for (std::size_t way = 0; way < 2; ++way) {
      const geometry::Head& head = rig_.heads()[sights[k].head];
      const Eigen::Vector3d d = head.seen_from_here(ray.direction() + kStep * tangents[way]);
      const std::optional<HeadSight> seen =
          see(head, optics.lens, {optics.right.dot(d), optics.down.dot(d), optics.axis.dot(d)}, optics.depth_per_px);
      const double moved = seen ? std::sqrt(seen->density * fade(*seen, true, optics.depth_per_px)) : 0.0;
      candidate.slope[static_cast<Eigen::Index>(way)] = (moved - candidate.score) / kStep;
    }
  }
  apply_seam(std::span(candidates).first(sights.size()), rig_.options().seam_width_deg * std::numbers::pi / 180);
  for (std::size_t k = 0; k < sights.size(); ++k) sights[k].weight = candidates[k].weight;
}

RaySample RowSampler::place(const Sight& sight, const geometry::Ray& ray) {
  const geometry::Head& head = rig_.heads()[sight.head];
  const RaySampler::Plane& picture = rig_.plane(grid_, sight.head);
  const PlaneGrid& plane_grid = picture.on_picture;
  // Within half a sample of the picture's edge there is no next sample: the position is clamped to the edge sample.
  RaySample sample{sight.head,
                   std::clamp(sight.pixel.x / plane_grid.step_x + plane_grid.offset_x - 0.5, 0.0, picture.width - 1.0),
                   std::clamp(sight.pixel.y / plane_grid.step_y + plane_grid.offset_y - 0.5, 0.0, picture.height - 1.0),
                   sight.weight, 1};
  if (rig_.options().undo_vignetting) {
    sample.gain = rig_.optics()[sight.head].undo.undo(head.vignetting(sight.pixel));
  }
  if (rig_.options().interpolation == Interpolation::kPixel) return sample;
  const double across = sight.pixel.x - head.calibration().center_x;
  const double down = (sight.pixel.y - head.calibration().center_y) / head.calibration().aspect;
  if (across * across + down * down < picture.same_radius * picture.same_radius) return sample;

  const auto x = std::min(static_cast<std::int32_t>(sample.x), picture.width - 2);
  const auto y = std::min(static_cast<std::int32_t>(sample.y), picture.height - 2);
  std::array<Eigen::Vector3d, 4> neighbours;
  for (std::int32_t k = 0; k < 4; ++k) {
    const CachedRay& neighbour = ray_of(sight.head, x + (k & 1), y + (k >> 1));
    if (!neighbour.exists) return sample;  // beyond the lens: there is no ray to interpolate
    neighbours[static_cast<std::size_t>(k)] = neighbour.direction;
  }
  const Fractions at = ray_fractions(TangentPlane(ray.direction()), neighbours, {sample.x - x, sample.y - y});
  sample.x = x + at.x;
  sample.y = y + at.y;
  return sample;
}

const RowSampler::CachedRay& RowSampler::ray_of(HeadIndex head, std::int32_t x, std::int32_t y) {
  // A direct-mapped cache: the rays of a raymap row lie on a curve in the picture, those of the next row close to it.
  constexpr std::int32_t kColumns = 1024;
  constexpr std::int32_t kRows = 8;
  std::vector<CachedRay>& rays = rays_[head];
  if (rays.empty()) rays.resize(static_cast<std::size_t>(kColumns) * kRows);
  CachedRay& cached = rays[static_cast<std::size_t>((x & (kColumns - 1)) + (y & (kRows - 1)) * kColumns)];
  if (cached.x == x && cached.y == y) return cached;
  const PlaneGrid& plane_grid = rig_.plane(grid_, head).on_picture;
  const geometry::Pixel pixel{(x + 0.5 - plane_grid.offset_x) * plane_grid.step_x,
                              (y + 0.5 - plane_grid.offset_y) * plane_grid.step_y};
  const std::optional<Eigen::Vector3d> direction = unproject(head, pixel);
  cached.x = x;
  cached.y = y;
  cached.exists = direction.has_value();
  if (direction) cached.direction = *direction;
  return cached;
}

/// Head::unproject, from lookup tables.
std::optional<Eigen::Vector3d> RowSampler::unproject(HeadIndex head, geometry::Pixel pixel) const {
  const geometry::Head& h = rig_.heads()[head];
  const double x = pixel.x - h.calibration().center_x;
  const double y = (pixel.y - h.calibration().center_y) / h.calibration().aspect;
  const double r = std::sqrt(x * x + y * y);
  const std::optional<double> a = rig_.optics()[head].lens.angle(r);
  if (!a) return std::nullopt;
  const double across = r > 0 ? std::sin(*a) / r : 0;
  const Eigen::Vector3d d(across * x, across * y, std::cos(*a));
  const Eigen::Matrix3d& R = h.R_head_rig();
  return h.seen_from_rig(Eigen::Vector3d(R.col(0).dot(d), R.col(1).dot(d), R.col(2).dot(d)));
}

}  // namespace nodal::table
