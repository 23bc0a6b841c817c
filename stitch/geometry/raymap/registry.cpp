#include "stitch/geometry/raymap/registry.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>

#include "protocol/base/angles.h"
#include "stitch/geometry/raymap/compressed_spherical.h"
#include "stitch/geometry/raymap/cube.h"
#include "stitch/geometry/raymap/cylinder.h"
#include "stitch/geometry/raymap/dual_disc.h"
#include "stitch/geometry/raymap/dymaxion.h"
#include "stitch/geometry/raymap/equirectangular.h"
#include "stitch/geometry/raymap/hammer.h"
#include "stitch/geometry/raymap/healpix.h"
#include "stitch/geometry/raymap/listed_rays.h"
#include "stitch/geometry/raymap/point_sequence.h"
#include "stitch/geometry/raymap/polyhedron.h"
#include "stitch/geometry/raymap/ray_list.h"
#include "stitch/geometry/raymap/sinusoidal.h"
#include "stitch/geometry/raymap/stratified_random.h"

namespace nodal::geometry {
namespace {

constexpr LayoutParameter kPad{"pad", 0, 64, 0};
constexpr LayoutParameter kFov{"fov", 10, 160, 90};
constexpr LayoutParameter kSeed{"seed", 0, 0xFFFF'FFFF, 1};

double one_half(std::int64_t) { return 0.5; }
double one_over_pi(std::int64_t) { return 1 / kPi; }
double of_central_cylinder(std::int64_t fov) { return std::tan(static_cast<double>(fov) * kPi / 360) / kPi; }
double of_tetrahedron(std::int64_t) { return std::sqrt(3.0) / 4; }
double of_icosahedron(std::int64_t) { return std::sqrt(3.0) / 5; }
double of_dymaxion(std::int64_t) { return 3 * std::sqrt(3.0) / 11; }

/// To add a layout: its header and source in this folder, and a line here. Radians across follow from each layout's
/// largest solid angle, which its header states.
const std::array kKinds{
    LayoutKind{"equirectangular", "latitude and longitude", &Equirectangular::make, 2 * kPi, {4, 2}},
    LayoutKind{"cube", "six faces, 3x2: right left up / down front back", &Cube::make_3x2, 6, {6, 4}, nullptr, kPad},
    LayoutKind{
        "cube_6x1", "six faces in a row: right left up down front back", &Cube::make_6x1, 12, {12, 2}, nullptr, kPad},
    LayoutKind{"cube_cross", "six faces as an unfolded cube, 4x3", &Cube::make_cross, 8, {8, 6}, nullptr, kPad},
    LayoutKind{"equiangular_cube",
               "3x2 faces: left front right / down back up, pixels evenly by angle",
               &Cube::make_equiangular,
               1.5 * kPi,
               {6, 4},
               nullptr,
               kPad},
    LayoutKind{"cylinder_equal_area",
               "a cylinder, rows evenly by height; all pixels span the same solid angle",
               &make_cylinder_equal_area,
               2 * kPi,
               {2, 2},
               &one_over_pi},
    LayoutKind{"central_cylinder",
               "a cylinder seen from its centre; fov degrees from bottom to top",
               &make_central_cylinder,
               2 * kPi,
               {2, 2},
               &of_central_cylinder,
               kFov},
    LayoutKind{"mercator", "a cylinder that keeps angles; up to 85.05 degrees", &make_mercator, 2 * kPi, {2, 2}},
    LayoutKind{
        "dual_fisheye", "two equidistant fisheyes of 180 degrees: front, back", &make_dual_fisheye, 2 * kPi, {4, 2}},
    LayoutKind{"dual_paraboloid", "two paraboloids: front, back", &make_dual_paraboloid, 8, {4, 2}},
    LayoutKind{"octahedron", "an octahedron unfolded to a square", &make_octahedron, 2 * std::pow(27, 0.25), {2, 2}},
    LayoutKind{"tetrahedron",
               "a tetrahedron unfolded to one row of triangles",
               &make_tetrahedron,
               4 * std::sqrt(6.0),
               {2, 2},
               &of_tetrahedron},
    LayoutKind{"icosahedron",
               "an icosahedron unfolded to two rows of triangles",
               &make_icosahedron,
               30 / (kIcosahedronInradius * 6),
               {2, 2},
               &of_icosahedron},
    LayoutKind{"dymaxion",
               "Fuller's map: an icosahedron, pixels more even, unfolded as for the Earth",
               &make_dymaxion,
               dymaxion_radians_across(),
               {2, 2},
               &of_dymaxion},
    LayoutKind{
        "sinusoidal", "rows as long as their circle of latitude; equal area", &Sinusoidal::make, 2 * kPi, {4, 2}},
    LayoutKind{"hammer", "Hammer's ellipse; equal area", &Hammer::make, 4 * std::sqrt(2.0), {4, 2}},
    LayoutKind{"compressed_spherical",
               "a row has as many pixels as its circle of latitude needs",
               &CompressedSpherical::make,
               2 * kPi,
               {4, 2}},
    LayoutKind{"healpix", "HEALPix: twelve faces of equal area, 4x3", &Healpix::make, 4 * std::sqrt(kPi / 3), {8, 6}},
    LayoutKind{"stratified_random",
               "random rays, sorted, in rows of equal area",
               &StratifiedRandom::make,
               std::sqrt(8 * kPi),
               {2, 2},
               &one_half,
               kSeed},
    LayoutKind{"hammersley",
               "the Hammersley points of low discrepancy",
               &make_hammersley,
               std::sqrt(8 * kPi),
               {2, 2},
               &one_half},
    LayoutKind{"halton", "the Halton points of low discrepancy", &make_halton, std::sqrt(8 * kPi), {2, 2}, &one_half},
};

std::optional<RaymapSize> size_of_list(std::int64_t digits) {
  const RayList* list = known_ray_list(std::bit_cast<std::uint64_t>(digits));
  return list != nullptr ? std::optional(list->size) : std::nullopt;
}

/// Its parameter is the number in its name.
const LayoutKind kRays{
    "rays", "a list of rays from a file", &ListedRays::make, std::sqrt(8 * kPi), {2, 2}, nullptr, {}, &size_of_list};
constexpr std::string_view kRaysPrefix = "rays:";
constexpr std::size_t kRaysDigits = 16;

/// The number in "rays:0123456789abcdef"; nothing in other text.
std::optional<std::uint64_t> digits_of(std::string_view text) {
  if (!text.starts_with(kRaysPrefix) || text.size() != kRaysPrefix.size() + kRaysDigits) return std::nullopt;
  std::uint64_t digits = 0;
  const auto [at, error] = std::from_chars(text.data() + kRaysPrefix.size(), text.data() + text.size(), digits, 16);
  return error == std::errc() && at == text.data() + text.size() ? std::optional(digits) : std::nullopt;
}

double ratio_of(const LayoutKind& kind, std::int64_t value) {
  return kind.ratio ? kind.ratio(value) : static_cast<double>(kind.step.height) / kind.step.width;
}

/// With padding, at least two pixels of each face must remain.
double least_width(const LayoutKind& kind, std::int64_t value) {
  return kind.parameter.key == "pad" ? kind.step.width * (static_cast<double>(value) + 1) : kind.step.width;
}

}  // namespace

std::span<const LayoutKind> layout_kinds() { return kKinds; }

std::string layout_list() {
  std::string names;
  for (const LayoutKind& kind : kKinds) names += std::string(kind.name) + ", ";
  return names + "rays:FILE";
}

Result<LayoutName> LayoutName::parse(std::string_view text, const ReadRayFile& read) {
  if (!text.starts_with(kRaysPrefix)) return parse(text);
  const std::optional<std::uint64_t> digits = digits_of(text);
  if (digits && known_ray_list(*digits)) return parse(text);
  const std::string file(text.substr(kRaysPrefix.size()));
  const Result<std::string> list = read(file);
  if (!list && digits) return parse(text);  // a name that a rig or another host gave
  if (!list) return fail(list.error());
  const Result<std::string> name = make_ray_list_known(*list);
  if (!name) return fail(name.error().in(file));
  return parse(*name);
}

Result<LayoutName> LayoutName::parse(std::string_view text) {
  if (text.starts_with(kRaysPrefix)) {
    const std::optional<std::uint64_t> digits = digits_of(text);
    if (digits && known_ray_list(*digits)) return LayoutName(kRays, std::bit_cast<std::int64_t>(*digits));
    return fail(Errc::kNotFound, "the list of rays '" + std::string(text.substr(kRaysPrefix.size(), 64)) +
                                     "' is not known here; give the file that has it: rays:FILE");
  }
  const std::string_view name = text.substr(0, text.find(':'));
  const auto kind = std::ranges::find(kKinds, name, &LayoutKind::name);
  if (kind == kKinds.end()) {
    return fail(Errc::kUnsupported,
                "no raymap layout is called '" + std::string(name.substr(0, 64)) + "'; there are: " + layout_list());
  }
  const LayoutParameter& parameter = kind->parameter;
  if (name.size() == text.size()) return LayoutName(*kind, parameter.otherwise);
  const std::string_view rest = text.substr(name.size() + 1);
  if (parameter.key.empty()) {
    return fail(Errc::kBadValue, "the raymap layout " + std::string(name) + " has no parameter, but '" +
                                     std::string(rest.substr(0, 64)) + "' follows its name");
  }
  const std::string key = std::string(parameter.key) + "=";
  std::int64_t value = 0;
  bool good = rest.starts_with(key);
  if (good) {
    const char* end = rest.data() + rest.size();
    const auto [at, error] = std::from_chars(rest.data() + key.size(), end, value);
    good = error == std::errc() && at == end && value >= parameter.least && value <= parameter.most;
  }
  if (!good) {
    return fail(Errc::kBadValue,
                fmt::format("raymap layout '{}': after {}: there may be {}N, a whole number from {} to {}",
                            text.substr(0, 64), name, key, parameter.least, parameter.most));
  }
  return LayoutName(*kind, value);
}

std::string LayoutName::text() const {
  if (is_ray_list()) {
    std::array<char, kRaysDigits> digits{};
    const auto end = std::to_chars(digits.begin(), digits.end(), std::bit_cast<std::uint64_t>(value_), 16).ptr;
    const std::string_view number(digits.begin(), end);
    return std::string(kRaysPrefix) + std::string(kRaysDigits - number.size(), '0') + std::string(number);
  }
  std::string text(kind_->name);
  const LayoutParameter& parameter = kind_->parameter;
  if (value_ != parameter.otherwise) text += fmt::format(":{}={}", parameter.key, value_);
  return text;
}

double LayoutName::width_for_resolution(double pixels_per_radian) const {
  // The padding is outside of the faces, on both sides of each column of them.
  const double padding = kind_->parameter.key == "pad" ? kind_->step.width * static_cast<double>(value_) : 0;
  return kind_->radians_across * pixels_per_radian + padding;
}

RaymapSize LayoutName::size_for_width(double width) const {
  if (is_ray_list()) return kind_->only_size(value_).value();
  const RaymapSize step = kind_->step;
  const double ratio = ratio_of(*kind_, value_);
  const int most = static_cast<int>(kMaxRaymapSide / std::max(1.0, ratio)) / std::max(step.width, step.height);
  const double steps = std::ceil(std::max(least_width(*kind_, value_), width) / step.width);
  const int count = steps >= 1 ? static_cast<int>(std::min<double>(steps, most)) : 1;
  if (!kind_->ratio) return RaymapSize{count * step.width, count * step.height};
  const int across = count * step.width;
  return RaymapSize{across, std::max(1, static_cast<int>(std::lround(across * ratio / step.height))) * step.height};
}

Status LayoutName::check_size(RaymapSize size) const {
  if (is_ray_list()) {
    const RaymapSize its = kind_->only_size(value_).value();
    if (its.width == size.width && its.height == size.height) return {};
    return fail(Errc::kBadValue, fmt::format("is not the size of the list of rays, {}x{}; leave width and height out",
                                             its.width, its.height));
  }
  const RaymapSize step = kind_->step;
  if (size.width >= least_width(*kind_, value_) && size.height > 0 && size.width % step.width == 0 &&
      size.height % step.height == 0) {
    const bool free = kind_->ratio != nullptr;
    if (free || size.width / step.width == size.height / step.height) return {};
  }
  const RaymapSize near = size_for_width(size.width);
  return fail(
      Errc::kBadValue,
      fmt::format("is not a size of the layout {}, whose {}; {}x{} would be", text(),
                  kind_->ratio ? "sides are even" : fmt::format("size is a multiple of {}x{}", step.width, step.height),
                  near.width, near.height));
}

}  // namespace nodal::geometry
