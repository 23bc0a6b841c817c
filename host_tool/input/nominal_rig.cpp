#include "host_tool/input/nominal_rig.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>

#include "host_tool/console/quantities.h"
#include "protocol/base/angles.h"
#include "protocol/base/polynomial.h"
#include "protocol/base/try.h"
#include "stitch/autocalibration/image_circle.h"
#include "stitch/autocalibration/lens_family.h"
#include "stitch/calibration/lens/region.h"
#include "stitch/geometry/rotation.h"
#include "stitch/media/image_file.h"

namespace nodal::host {
namespace {

using autocalibration::Family;

// Parses numbers separated by `between`; nothing if the text is anything else.
std::vector<double> numbers(std::string_view text, char between) {
  std::vector<double> all;
  while (!text.empty()) {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc()) return {};
    all.push_back(value);
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
    if (text.empty()) break;
    if (text.front() != between || text.size() == 1) return {};
    text.remove_prefix(1);
  }
  return all;
}

// The circle in which a fisheye's picture is not black, or else the largest circle centred in the picture.
Region::Circle circle_in(const ImageView& picture) {
  const DecodedImage grey = media::convert_image(picture, PixelFormat::kGrey8);
  calibration::GreyImage levels(grey.width, grey.height);
  std::ranges::transform(grey.bytes, levels.values.begin(),
                         [](std::uint8_t level) { return static_cast<float>(level) / 255; });
  const Region region = calibration::find_region({&levels});
  if (region.circle) return {region.circle->x, region.circle->y, region.circle->radius + calibration::kEdgeBlur};
  // The edge may be blurred, or partly outside of the picture.
  const autocalibration::Picture small = autocalibration::reduced(grey, autocalibration::kEdgeSide);
  if (const auto circle = autocalibration::find_image_circle(small)) {
    const double scale = static_cast<double>(grey.width) / small.width;
    return {circle->x * scale, circle->y * scale, circle->radius * scale};
  }
  return {grey.width / 2.0, grey.height / 2.0, std::min(grey.width, grey.height) / 2.0};
}

void set_fisheye(HeadCalibration& head, const Region::Circle& circle, Family family, double view_deg) {
  head.center_x = circle.x;
  head.center_y = circle.y;
  head.max_angle = view_deg / 2 * kRadiansPerDegree;
  if (family == Family::kEquidistant) {
    head.lens = EquidistantLens{{circle.radius / head.max_angle}};
  } else {
    KannalaBrandtLens lens = autocalibration::family_lens(family, head.max_angle);
    // The radius at the edge is the circle's.
    const double squared = head.max_angle * head.max_angle;
    const std::array<double, 5> terms{1, lens.k[0], lens.k[1], lens.k[2], lens.k[3]};
    lens.focal = circle.radius / (head.max_angle * polynomial_value(terms, squared));
    head.lens = lens;
  }
  head.region.circle = circle;
  head.vignetting = {circle.x, circle.y, circle.radius, {}};
}

void set_rectilinear(HeadCalibration& head, double view_deg) {
  head.center_x = head.width / 2.0;
  head.center_y = head.height / 2.0;
  head.lens = RectilinearLens{{head.width / 2.0 / std::tan(view_deg / 2 * kRadiansPerDegree)}};
  head.vignetting = {head.center_x, head.center_y, std::hypot(head.center_x, head.center_y), {}};
}

/// The widest field of view of a family's lenses, degrees. Beyond, orthographic lenses show nothing, the rim of others
/// would be far outside of any sensor.
double widest_view(Family family) {
  switch (family) {
    case Family::kRectilinear:
    case Family::kOrthographic: return 170;
    case Family::kStereographic: return 270;
    default: return 300;
  }
}

Status check_nominal(const Nominal& nominal, Family lens) {
  const auto heads = static_cast<std::size_t>(nominal.heads);
  if (nominal.circles.size() > 1 && nominal.circles.size() != heads) {
    return fail(Errc::kBadValue,
                fmt::format("--circle: {} circles for {} heads; give one for all, or one for each head",
                            nominal.circles.size(), heads));
  }
  if (!nominal.places.empty() && nominal.places.size() != heads) {
    return fail(Errc::kBadValue, fmt::format("--at: {} for {} heads; give one for each head",
                                             counted(nominal.places.size(), "place"), heads));
  }
  if (nominal.view_deg > widest_view(lens)) {
    return fail(Errc::kBadValue, fmt::format("--nominal: {:g} degrees, but --lens {} can have at most {:g}",
                                             nominal.view_deg, nominal.lens, widest_view(lens)));
  }
  if (lens == Family::kRectilinear && !nominal.circles.empty()) {
    return fail(Errc::kBadValue, "--circle: a rectilinear lens has none; leave it out, or say --lens fisheye");
  }
  return {};
}

}  // namespace

Result<Nominal> parse_nominal(const std::string& text) {
  const std::vector<double> two = numbers(text, 'x');
  const bool good = two.size() == 2 && two[0] == static_cast<int>(two[0]) && two[0] >= 2 && two[0] <= 64 &&
                    two[1] >= 20 && two[1] <= 300;
  if (!good) return fail(Errc::kBadValue, "'" + text + "': heads and their field of view in degrees, such as 3x190");
  Nominal nominal;
  nominal.heads = static_cast<int>(two[0]);
  nominal.view_deg = two[1];
  return nominal;
}

Result<Region::Circle> parse_circle(const std::string& text) {
  const std::vector<double> three = numbers(text, ',');
  if (three.size() != 3 || !(three[2] > 1)) {
    return fail(Errc::kBadValue, "'" + text + "': x, y and radius in pixels, such as 1920,1080,1587");
  }
  return Region::Circle{three[0], three[1], three[2]};
}

Result<NominalPlace> parse_place(const std::string& text) {
  const std::vector<double> given = numbers(text, ',');
  const bool good = (given.size() == 2 || given.size() == 3) && std::abs(given[0]) <= 360 && std::abs(given[1]) <= 90 &&
                    (given.size() == 2 || std::abs(given[2]) <= 360);
  if (!good) {
    return fail(Errc::kBadValue, "'" + text +
                                     "': yaw to the right and pitch up in degrees, and roll clockwise if there is any, "
                                     "such as 90,-30 or 90,-30,180");
  }
  return NominalPlace{given[0], given[1], given.size() == 3 ? given[2] : 0};
}

Result<std::string> parse_nominal_lens(const std::string& text) {
  if (text == "fisheye") return std::string(autocalibration::family_name(Family::kEquidistant));
  if (autocalibration::family_named(text)) return text;
  return fail(Errc::kBadValue, "'" + text +
                                   "': fisheye (the same as equidistant), equidistant, equisolid, stereographic, "
                                   "orthographic or rectilinear");
}

Result<Nominal> nominal_of(const NominalWords& words) {
  Result<Nominal> nominal = parse_nominal(words.rig);
  if (!nominal) return fail(nominal.error().in("--nominal"));
  nominal->roll_deg = words.roll_deg;
  const Result<std::string> lens = parse_nominal_lens(words.lens);
  if (!lens) return fail(lens.error().in("--lens"));
  nominal->lens = *lens;
  for (const std::string& word : words.places) {
    const Result<NominalPlace> place = parse_place(word);
    if (!place) return fail(place.error().in("--at"));
    nominal->places.push_back(*place);
  }
  for (const std::string& word : words.circles) {
    const Result<Region::Circle> circle = parse_circle(word);
    if (!circle) return fail(circle.error().in("--circle"));
    nominal->circles.push_back(*circle);
  }
  return nominal;
}

Result<Calibration> nominal_rig(const Nominal& nominal, std::span<const ImageView> pictures) {
  const auto heads = static_cast<std::size_t>(nominal.heads);
  if (pictures.size() != heads) {
    return fail(Errc::kBadValue, fmt::format("--nominal: {} pictures for {} heads", pictures.size(), heads));
  }
  const std::optional<Family> family = autocalibration::family_named(nominal.lens);
  if (!family) return fail(Errc::kBadValue, "--lens: '" + nominal.lens + "' is no kind of lens");
  NODAL_TRY(check_nominal(nominal, *family));
  Calibration rig;
  rig.name = fmt::format("nominal {}x{:g}", nominal.heads, nominal.view_deg);
  rig.comment = "From the data sheet.";
  for (std::size_t h = 0; h < heads; ++h) {
    HeadCalibration head;
    head.name = fmt::format("cam{}", h);
    head.width = pictures[h].width;
    head.height = pictures[h].height;
    head.region = {0, 0, static_cast<double>(head.width), static_cast<double>(head.height), {}, {}};
    if (*family == Family::kRectilinear) {
      set_rectilinear(head, nominal.view_deg);
    } else {
      set_fisheye(head,
                  nominal.circles.empty()       ? circle_in(pictures[h])
                  : nominal.circles.size() == 1 ? nominal.circles.front()
                                                : nominal.circles[h],
                  *family, nominal.view_deg);
    }
    NominalPlace place;
    place.yaw = 360.0 * static_cast<double>(h) / nominal.heads;
    if (place.yaw > 180) place.yaw -= 360;
    if (!nominal.places.empty()) place = nominal.places[h];
    head.R_head_rig =
        geometry::rows_of(geometry::to_R_head_rig({place.yaw, place.pitch, place.roll + nominal.roll_deg}));
    rig.heads.push_back(head);
  }
  if (Status good = check_calibration(rig); !good) return fail(good.error().in("--nominal"));
  return rig;
}

}  // namespace nodal::host
