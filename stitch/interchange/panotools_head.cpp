#include "stitch/interchange/panotools_head.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "protocol/lens_range.h"
#include "stitch/geometry/rotation.h"
#include "stitch/interchange/project.h"

namespace nodal::interchange {
namespace {

Result<LensModel> to_lens(const PanotoolsImage& image) {
  const double width = image.lens.right - image.lens.left;
  const double height = image.lens.bottom - image.lens.top;
  if (!(width >= 1 && height >= 1 && width <= 1e6 && height <= 1e6)) {
    return fail(Errc::kBadValue, "its crop is " + short_number(width) + " x " + short_number(height) +
                                     " px; left must be less than right, top than bottom");
  }
  const bool rectilinear = image.projection == 0;
  if (!rectilinear && image.projection != 2 && image.projection != 3) {
    return fail(Errc::kUnsupported,
                fmt::format("its lens type f{} has no counterpart here; rectilinear (f0) and equidistant fisheyes (f2, "
                            "f3) have: convert the lens in the program that wrote the file",
                            image.projection));
  }
  if (!(image.hfov > 0 && image.hfov < (rectilinear ? 180 : 720))) {
    return fail(Errc::kBadValue, "its horizontal field of view v is " + short_number(image.hfov) + " degrees");
  }
  const double v = image.hfov * kRadiansPerDegree;
  const double f = rectilinear ? width / 2 / std::tan(v / 2) : width / v;
  const double n = std::min(width, height) / 2;
  const double p = f / n;  // p for an angle or tangent of 1
  std::vector<double> coefficients{n * p * (1 - image.a - image.b - image.c), n * p * p * image.c,
                                   n * p * p * p * image.b, n * p * p * p * p * image.a};
  while (coefficients.size() > 1 && coefficients.back() == 0) coefficients.pop_back();
  if (rectilinear) return LensModel(RectilinearLens{std::move(coefficients)});
  return LensModel(EquidistantLens{std::move(coefficients)});
}

Status set_region(const PanotoolsImage& image, HeadCalibration& head, std::vector<std::string>& notes) {
  const double width = image.width, height = image.height;
  const Crop kept = image.region.value_or(Crop{0, width, 0, height});
  const auto clamped = [](double value, double most) { return std::clamp(value, 0.0, most); };
  head.region = {clamped(kept.left, width),
                 clamped(kept.top, height),
                 clamped(kept.right, width),
                 clamped(kept.bottom, height),
                 {}};
  if (image.projection == 2) {
    head.region.circle = {(kept.left + kept.right) / 2, (kept.top + kept.bottom) / 2,
                          std::min(kept.right - kept.left, kept.bottom - kept.top) / 2};
    if (!image.region) {
      notes.push_back("Head '" + head.name +
                      "' has a circular fisheye without a crop: the largest circle in its picture "
                      "is taken as what the lens shows; set region.circle if it is another.");
    }
  }
  return {};
}

/// A part of the largest radius. Registration may change the focal length by more than the rest.
constexpr double kSafelyInside = 0.97;

/// If the polynomial turns back inside the region or close to its edge, the lens is limited to slightly less than that
/// angle.
void set_max_angle(HeadCalibration& head, std::vector<std::string>& notes) {
  const LensRange range = lens_range(head.lens);
  const double farthest = farthest_radius(head.region, head.center_x, head.center_y, head.aspect);
  if (farthest <= (range.turns ? kSafelyInside : 1) * range.max_radius || range.max_radius < 1) return;
  head.max_angle = range.turns ? 0.99 * range.max_angle : range.max_angle;
  notes.push_back("The lens of head '" + head.name + "' " + (range.turns ? "has its largest radius" : "ends") + " at " +
                  short_number(range.max_angle / kRadiansPerDegree) + " degrees, " + short_number(range.max_radius) +
                  " px from its centre, and the picture reaches " + short_number(farthest) +
                  " px: the lens is used up to " + short_number(head.max_angle / kRadiansPerDegree) + " degrees.");
}

}  // namespace

Status read_geometry(const ImageLines& images, std::size_t image, PanotoolsImage& out) {
  const std::string line = fmt::format("line {}", images[image].number);
  double projection = 0;
  const std::array<std::pair<const char*, double*>, 9> optional{{{"f", &projection},
                                                                 {"a", &out.a},
                                                                 {"b", &out.b},
                                                                 {"c", &out.c},
                                                                 {"d", &out.d},
                                                                 {"e", &out.e},
                                                                 {"y", &out.yaw},
                                                                 {"p", &out.pitch},
                                                                 {"r", &out.roll}}};
  for (const auto& [name, value] : optional) {
    NODAL_TRY_ASSIGN(const double number, images.number_or(image, name, 0));
    *value = number;
  }
  if (!(projection >= 0 && projection <= 1000)) return fail(Errc::kBadValue, line + ": lens type f is out of range");
  out.projection = static_cast<int>(projection);
  NODAL_TRY_ASSIGN(const std::optional<double> v, images.find_number(image, "v"));
  if (!v) return fail(Errc::kMissingField, line + ": the image has no field of view (v)");
  out.hfov = *v;
  return {};
}

Result<HeadCalibration> to_head(const PanotoolsImage& image, std::vector<std::string>& notes) {
  HeadCalibration head;
  head.name = image.name;
  head.width = image.width;
  head.height = image.height;
  const std::string who = "head '" + image.name + "'";
  Result<LensModel> lens = to_lens(image);
  if (!lens) return fail(lens.error().in(who));
  head.lens = std::move(*lens);
  head.center_x = (image.lens.left + image.lens.right) / 2 + image.d;
  head.center_y = (image.lens.top + image.lens.bottom) / 2 + image.e;
  head.R_head_rig = geometry::rows_of(geometry::to_R_head_rig({image.yaw, image.pitch, image.roll}));
  if (Status s = set_region(image, head, notes); !s) return fail(s.error().in(who));
  set_max_angle(head, notes);
  head.vignetting = {head.center_x, head.center_y, std::hypot(head.width, head.height) / 2, {}};
  NODAL_TRY(check_head(head));
  return head;
}

std::string head_name(std::string_view path, const std::vector<std::string>& taken) {
  const std::size_t folder = path.find_last_of("/\\");
  if (folder != std::string_view::npos) path.remove_prefix(folder + 1);
  const std::size_t extension = path.find_last_of('.');
  if (extension != std::string_view::npos && extension > 0) path = path.substr(0, extension);
  std::string name;
  for (const char c : path.substr(0, 48)) {
    const bool plain =
        (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '_' || c == '-';
    name += plain ? c : '_';
  }
  if (name.empty()) name = fmt::format("head{}", taken.size());
  std::string unlike = name;
  for (int n = 2; std::ranges::find(taken, unlike) != taken.end(); ++n) unlike = fmt::format("{}-{}", name, n);
  return unlike;
}

}  // namespace nodal::interchange
