// From a Calibration to JSON: the form for human readers, and the canonical form.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "protocol/calibration.h"
#include "protocol/lens_range.h"

namespace nodal {
namespace {

using Json = nlohmann::ordered_json;

Json lens_fields(const TsaiLens& lens) {
  return {{"model", "tsai"}, {"focal", lens.focal}, {"kappa1", lens.kappa1}, {"kappa2", lens.kappa2}};
}
Json lens_fields(const RectilinearLens& lens) {
  return {{"model", "rectilinear"}, {"coefficients", lens.coefficients}};
}
Json lens_fields(const EquidistantLens& lens) {
  return {{"model", "equidistant"}, {"coefficients", lens.coefficients}};
}
Json lens_fields(const KannalaBrandtLens& lens) {
  return {{"model", "kannala_brandt"}, {"focal", lens.focal}, {"k", lens.k}};
}

Json region_fields(const Region& region) {
  Json fields{{"left", region.left}, {"top", region.top}, {"right", region.right}, {"bottom", region.bottom}};
  if (region.circle) {
    fields["circle"] = {{"x", region.circle->x}, {"y", region.circle->y}, {"radius", region.circle->radius}};
  }
  if (!region.masks.empty()) {
    Json masks = Json::array();
    for (const std::vector<Region::Point>& mask : region.masks) {
      Json points = Json::array();
      for (const Region::Point& point : mask) points.push_back(Json::array({point.x, point.y}));
      masks.push_back(std::move(points));
    }
    fields["masks"] = std::move(masks);
  }
  return fields;
}

Json response_fields(const Response& response) {
  switch (response.curve) {
    case Response::Curve::kLinear: return {{"curve", "linear"}};
    case Response::Curve::kGamma: return {{"curve", "gamma"}, {"gamma", response.gamma}};
    case Response::Curve::kSrgb: return {{"curve", "srgb"}};
    case Response::Curve::kPolynomial: return {{"curve", "polynomial"}, {"coefficients", response.coefficients}};
  }
  return Json::object();
}

bool placed(const HeadCalibration& head) { return head.position != std::array<double, 3>{}; }

/// Older readers refuse fields that they do not know; what has none of them keeps the version, and so its id.
int version_of(const Calibration& calibration) {
  const auto masked = [](const HeadCalibration& head) { return !head.region.masks.empty(); };
  if (calibration.distance > 0 || std::ranges::any_of(calibration.heads, placed)) return 3;
  return std::ranges::any_of(calibration.heads, masked) ? 2 : 1;
}

Json head_fields(const HeadCalibration& head) {
  Json fields;
  fields["name"] = head.name;
  fields["width"] = head.width;
  fields["height"] = head.height;
  fields["center"] = Json::array({head.center_x, head.center_y});
  fields["aspect"] = head.aspect;
  fields["lens"] = std::visit([](const auto& lens) { return lens_fields(lens); }, head.lens);
  fields["max_angle"] = head.max_angle;
  Json rows = Json::array();
  for (std::size_t i = 0; i < 9; i += 3) {
    rows.push_back(Json::array({head.R_head_rig[i], head.R_head_rig[i + 1], head.R_head_rig[i + 2]}));
  }
  fields["R_head_rig"] = rows;
  if (placed(head)) fields["position"] = head.position;
  fields["region"] = region_fields(head.region);
  fields["response"] = response_fields(head.response);
  const Vignetting& v = head.vignetting;
  fields["vignetting"] = {{"x", v.x}, {"y", v.y}, {"radius", v.radius}, {"coefficients", v.coefficients}};
  fields["gain"] = {{"red", head.gain[0]}, {"green", head.gain[1]}, {"blue", head.gain[2]}};
  return fields;
}

Json document(const Calibration& calibration) {
  Json heads = Json::array();
  for (const HeadCalibration& head : calibration.heads) heads.push_back(head_fields(head));
  Json fields;
  fields["nodal_calibration"] = version_of(calibration);
  fields["name"] = calibration.name;
  fields["comment"] = calibration.comment;
  if (calibration.distance > 0) fields["distance"] = calibration.distance;
  fields["heads"] = std::move(heads);
  return fields;
}

/// The shortest digits that read back as the same double; no "-0", no ".0".
std::string shortest_number(double value) {
  if (!std::isfinite(value)) return "null";  // JSON has no other form for it; the parser refuses it
  if (value == 0) return "0";
  char text[32];
  const auto [end, error] = std::to_chars(text, text + sizeof text, value);
  return std::string(text, end);
}

std::string scalar(const Json& value) {
  if (value.is_number()) return shortest_number(value.get<double>());
  return value.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string quoted(const std::string& key) { return scalar(Json(key)); }

/// Members in the order in which they are written; array elements have no key.
struct Member {
  std::string key;
  const Json* value;
};

std::vector<Member> members_of(const Json& value, bool sorted) {
  std::vector<Member> members;
  if (value.is_array()) {
    for (const Json& element : value) members.push_back({"", &element});
    return members;
  }
  for (const auto& [key, member] : value.items()) members.push_back({key, &member});
  if (sorted) std::ranges::sort(members, {}, &Member::key);
  return members;
}

std::string on_one_line(const Json& value, bool canonical) {
  if (!value.is_structured()) return scalar(value);
  const bool array = value.is_array();
  std::string text(array ? "[" : "{");
  for (const Member& member : members_of(value, canonical)) {
    if (text.size() > 1) text += canonical ? "," : ", ";
    if (!array) text += quoted(member.key) + (canonical ? ":" : ": ");
    text += on_one_line(*member.value, canonical);
  }
  return text + (array ? "]" : "}");
}

constexpr std::size_t kColumns = 110;

/// Writes a value on one line if it fits; longer values and lists of objects are broken up and indented by two.
std::string for_people(const Json& value, std::size_t indent, std::size_t before) {
  const bool list_of_objects = value.is_array() && !value.empty() && value.front().is_object();
  const std::string line = on_one_line(value, false);
  if (!value.is_structured() || value.empty()) return line;
  if (!list_of_objects && indent > 0 && before + line.size() <= kColumns) return line;
  const bool array = value.is_array();
  std::string text(array ? "[" : "{");
  for (const Member& member : members_of(value, false)) {
    text += text.size() > 1 ? ",\n" : "\n";
    const std::string start = std::string(indent + 2, ' ') + (array ? "" : quoted(member.key) + ": ");
    text += start + for_people(*member.value, indent + 2, start.size());
  }
  return text + "\n" + std::string(indent, ' ') + (array ? "]" : "}");
}

}  // namespace

std::string to_json(const Calibration& calibration) { return for_people(document(calibration), 0, 0) + "\n"; }

std::string canonical_json(const Calibration& calibration) { return on_one_line(document(calibration), true); }

Sha256 calibration_id(const Calibration& calibration) {
  const std::string text = canonical_json(calibration);
  return sha256({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

}  // namespace nodal
