// From JSON to a checked Calibration. Every field must be present and known; the first problem is the error.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "protocol/base/try.h"
#include "protocol/base/units.h"
#include "protocol/calibration.h"
#include "protocol/calibration_limits.h"
#include "protocol/strict_json.h"

namespace nodal {
namespace {

using nlohmann::json;

/// Reads the fields of one object; fields left over at the end are unknown. The first problem is stored in `error`;
/// later reads return harmless values.
class Fields {
 public:
  Fields(const json* object, std::string where, std::optional<Error>& error)
      : object_(object), where_(std::move(where)), error_(error) {
    if (object_ && !object_->is_object()) refuse(Errc::kBadValue, "must be an object, { }");
  }

  void rename(std::string where) { where_ = std::move(where); }

  double number(const char* key) {
    const json* value = take(key);
    if (value && !value->is_number()) refuse(key, "must be a number");
    return value && value->is_number() ? value->get<double>() : 0;
  }

  int whole(const char* key) {
    const double value = number(key);
    if (value >= -1e9 && value <= 1e9 && value == std::floor(value)) return static_cast<int>(value);
    refuse(key, "must be a whole number");
    return 0;
  }

  std::string text(const char* key) {
    const json* value = take(key);
    if (value && !value->is_string()) refuse(key, "must be text, in quotes");
    return value && value->is_string() ? value->get<std::string>() : std::string();
  }

  /// Reads `count` numbers, or any number of them if `count` is 0.
  std::vector<double> numbers(const char* key, std::size_t count) { return list(take(key), key, count); }

  /// Row-major.
  std::array<double, 9> matrix(const char* key) {
    std::array<double, 9> rows{};
    const json* value = take(key);
    if (!value) return rows;
    if (!value->is_array() || value->size() != 3) {
      refuse(key, "must be three rows of three numbers");
      return rows;
    }
    for (std::size_t i = 0; i < 3; ++i) {
      const std::vector<double> row = list(&(*value)[i], key, 3);
      for (std::size_t j = 0; j < row.size(); ++j) rows[3 * i + j] = row[j];
    }
    return rows;
  }

  /// Parses lists of points, [[[x, y], ...], ...]. Stops at the first list or point beyond the limit.
  std::vector<std::vector<Region::Point>> polygons(const char* key, std::size_t most, std::size_t most_points) {
    std::vector<std::vector<Region::Point>> polygons;
    const json* value = array(key);
    std::size_t points = 0;
    for (std::size_t k = 0; value && k < value->size() && polygons.size() <= most; ++k) {
      const json& polygon = (*value)[k];
      polygons.emplace_back();
      if (!polygon.is_array()) refuse(key, "must be lists of points, [[[x, y], ...], ...]");
      for (std::size_t p = 0; !error_ && p < polygon.size() && points <= most_points; ++p, ++points) {
        const std::vector<double> at = list(&polygon[p], key, 2);
        if (!error_) polygons.back().push_back({at[0], at[1]});
      }
    }
    return polygons;
  }

  Fields object(const char* key) { return Fields(take(key), where_ + ": " + key, error_); }

  bool has(const char* key) const { return object_ && object_->is_object() && object_->contains(key); }

  const json* array(const char* key) {
    const json* value = take(key);
    if (value && !value->is_array()) refuse(key, "must be a list, [ ]");
    return value && value->is_array() ? value : nullptr;
  }

  void refuse(Errc code, const std::string& what) {
    if (error_) return;
    error_ = Error{code, what};
    if (!where_.empty()) error_ = error_->in(where_);
  }

  /// Call after all fields have been read.
  void done() {
    if (error_ || !object_ || !object_->is_object()) return;
    for (const auto& [key, value] : object_->items()) {
      if (known_.find("'" + key + "'") == std::string::npos) {
        refuse(Errc::kUnknownField, "'" + key.substr(0, 64) + "' is not a field here; there are " + known_);
      }
    }
  }

 private:
  const json* take(const char* key) {
    if (!known_.empty()) known_ += ", ";
    known_.append("'").append(key).append("'");
    if (error_ || !object_ || !object_->is_object()) return nullptr;
    const auto found = object_->find(key);
    if (found != object_->end()) return &*found;
    refuse(Errc::kMissingField, "the field '" + std::string(key) + "' is missing");
    return nullptr;
  }

  std::vector<double> list(const json* value, const char* key, std::size_t count) {
    if (!value) return {};
    std::vector<double> numbers;
    bool good = value->is_array() && (count == 0 || value->size() == count);
    if (good) {
      for (const json& element : *value) {
        good = good && element.is_number();
        if (good) numbers.push_back(element.get<double>());
      }
    }
    if (good) return numbers;
    refuse(key, count == 0 ? "must be a list of numbers" : fmt::format("must be a list of {} numbers", count));
    return {};
  }

  void refuse(const char* key, const std::string& what) { refuse(Errc::kBadValue, std::string(key) + " " + what); }

  const json* object_;
  std::string where_;
  std::optional<Error>& error_;
  std::string known_;
};

template <std::size_t N>
std::array<double, N> fixed(const std::vector<double>& values) {
  std::array<double, N> result{};
  for (std::size_t k = 0; k < std::min(N, values.size()); ++k) result[k] = values[k];
  return result;
}

LensModel parse_lens(Fields fields) {
  LensModel lens;
  const std::string model = fields.text("model");
  if (model == "tsai") {
    TsaiLens tsai;
    tsai.focal = fields.number("focal");
    tsai.kappa1 = fields.number("kappa1");
    tsai.kappa2 = fields.number("kappa2");
    lens = tsai;
  } else if (model == "rectilinear") {
    lens = RectilinearLens{fields.numbers("coefficients", 0)};
  } else if (model == "equidistant") {
    lens = EquidistantLens{fields.numbers("coefficients", 0)};
  } else if (model == "kannala_brandt") {
    KannalaBrandtLens kannala_brandt;
    kannala_brandt.focal = fields.number("focal");
    kannala_brandt.k = fixed<4>(fields.numbers("k", 4));
    lens = kannala_brandt;
  } else {
    fields.refuse(Errc::kUnsupported, "no lens model is called '" + model.substr(0, 64) +
                                          "'; there are tsai, rectilinear, equidistant and kannala_brandt");
  }
  fields.done();
  return lens;
}

Region parse_region(Fields fields) {
  Region region;
  region.left = fields.number("left");
  region.top = fields.number("top");
  region.right = fields.number("right");
  region.bottom = fields.number("bottom");
  if (fields.has("circle")) {
    Fields circle = fields.object("circle");
    region.circle = Region::Circle{};
    region.circle->x = circle.number("x");
    region.circle->y = circle.number("y");
    region.circle->radius = circle.number("radius");
    circle.done();
  }
  if (fields.has("masks")) region.masks = fields.polygons("masks", kMaxMasks, kMaxMaskPoints);
  fields.done();
  return region;
}

Response parse_response(Fields fields) {
  Response response;
  const std::string curve = fields.text("curve");
  if (curve == "linear") {
    response.curve = Response::Curve::kLinear;
  } else if (curve == "srgb") {
    response.curve = Response::Curve::kSrgb;
  } else if (curve == "gamma") {
    response.curve = Response::Curve::kGamma;
    response.gamma = fields.number("gamma");
  } else if (curve == "polynomial") {
    response.curve = Response::Curve::kPolynomial;
    response.coefficients = fields.numbers("coefficients", 0);
  } else {
    fields.refuse(Errc::kUnsupported, "no response curve is called '" + curve.substr(0, 64) +
                                          "'; there are linear, gamma, srgb and polynomial");
  }
  fields.done();
  return response;
}

Vignetting parse_vignetting(Fields fields) {
  Vignetting vignetting;
  vignetting.x = fields.number("x");
  vignetting.y = fields.number("y");
  vignetting.radius = fields.number("radius");
  vignetting.coefficients = fixed<3>(fields.numbers("coefficients", 3));
  fields.done();
  return vignetting;
}

/// Two Newton iterations to the nearest rotation, for a matrix that is a rotation to 1e-6. A matrix that is one to the
/// last digits is not changed, so that a document that is read and written again has the same bytes.
std::array<double, 9> orthonormal(std::array<double, 9> R) {
  for (int step = 0; step < 2; ++step) {
    std::array<double, 9> excess{};  // R R^T - 1
    double off = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) {
        double& e = excess[3 * i + j];
        e = i == j ? -1 : 0;
        for (std::size_t k = 0; k < 3; ++k) e += R[3 * i + k] * R[3 * j + k];
        off = std::max(off, std::abs(e));
      }
    }
    if (!(off > 1e-14 && off < 1e-3)) return R;
    const std::array<double, 9> before = R;
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) {
        for (std::size_t k = 0; k < 3; ++k) R[3 * i + j] -= 0.5 * excess[3 * i + k] * before[3 * k + j];
      }
    }
  }
  return R;
}

HeadCalibration parse_head(Fields fields) {
  HeadCalibration head;
  head.name = fields.text("name");
  if (!head.name.empty()) fields.rename("head '" + head.name.substr(0, 64) + "'");
  head.width = fields.whole("width");
  head.height = fields.whole("height");
  const auto center = fixed<2>(fields.numbers("center", 2));
  head.center_x = center[0];
  head.center_y = center[1];
  head.aspect = fields.number("aspect");
  head.lens = parse_lens(fields.object("lens"));
  head.max_angle = fields.number("max_angle");
  head.R_head_rig = orthonormal(fields.matrix("R_head_rig"));
  if (fields.has("position")) head.position = fixed<3>(fields.numbers("position", 3));
  head.region = parse_region(fields.object("region"));
  head.response = parse_response(fields.object("response"));
  head.vignetting = parse_vignetting(fields.object("vignetting"));
  Fields gain = fields.object("gain");
  head.gain = {gain.number("red"), gain.number("green"), gain.number("blue")};
  gain.done();
  fields.done();
  return head;
}

/// Every field that a calibration may have, with as much of each as can be right.
JsonShape calibration_shape() {
  const JsonShape value = JsonShape::value(256);
  const JsonShape numbers = JsonShape::list(16, value);
  const JsonShape lens = JsonShape::object({{"model", value},
                                            {"focal", value},
                                            {"kappa1", value},
                                            {"kappa2", value},
                                            {"coefficients", numbers},
                                            {"k", numbers}});
  const JsonShape circle = JsonShape::object({{"x", value}, {"y", value}, {"radius", value}});
  const JsonShape masks = JsonShape::list(kMaxMasks, JsonShape::list(kMaxMaskPoints, numbers));
  const JsonShape region = JsonShape::object(
      {{"left", value}, {"top", value}, {"right", value}, {"bottom", value}, {"circle", circle}, {"masks", masks}});
  const JsonShape response = JsonShape::object({{"curve", value}, {"gamma", value}, {"coefficients", numbers}});
  const JsonShape vignetting =
      JsonShape::object({{"x", value}, {"y", value}, {"radius", value}, {"coefficients", numbers}});
  const JsonShape head =
      JsonShape::object({{"name", value},
                         {"width", value},
                         {"height", value},
                         {"center", numbers},
                         {"aspect", value},
                         {"lens", lens},
                         {"max_angle", value},
                         {"R_head_rig", JsonShape::list(3, numbers)},
                         {"position", numbers},
                         {"region", region},
                         {"response", response},
                         {"vignetting", vignetting},
                         {"gain", JsonShape::object({{"red", value}, {"green", value}, {"blue", value}})}});
  return JsonShape::object({{"nodal_calibration", value},
                            {"name", value},
                            {"comment", JsonShape::value(kMaxCalibrationBytes)},
                            {"distance", value},
                            {"heads", JsonShape::list(kMaxCalibratedHeads, head)}});
}

/// Checked first: a newer document may have fields that this version does not know.
Status check_version(const json& document) {
  if (!document.is_object() || !document.contains("nodal_calibration")) {
    return fail(Errc::kBadFormat,
                "this is not a Nodal calibration: it has no field 'nodal_calibration' that states the version; "
                "files of other programs go through `nodal import` first");
  }
  const json& version = document["nodal_calibration"];
  if (!version.is_number_integer() || version < 1) {
    return fail(Errc::kBadValue, "nodal_calibration must be the document's version, a whole number from 1 on");
  }
  if (version > kCalibrationVersion) {
    return fail(Errc::kFutureVersion,
                fmt::format("the calibration is of version {}, and this Nodal reads up to {}: update Nodal here, or "
                            "write the calibration again with a Nodal of this age",
                            version.dump(), kCalibrationVersion));
  }
  return {};
}

}  // namespace

Result<Calibration> parse_calibration(std::string_view text) {
  static const JsonShape kShape = calibration_shape();
  NODAL_TRY_ASSIGN(json document, parse_strict_json(text, {kMaxCalibrationBytes, 8}, kShape));
  NODAL_TRY(check_version(document));

  std::optional<Error> error;
  Fields fields(&document, "", error);
  Calibration calibration;
  fields.whole("nodal_calibration");
  calibration.name = fields.text("name");
  calibration.comment = fields.text("comment");
  if (fields.has("distance")) {
    calibration.distance = fields.number("distance");
    if (!error && !(calibration.distance > 0)) {
      fields.refuse(Errc::kBadValue, "distance must be above 0 m; leave it out for infinity");
    }
  }
  if (const json* heads = fields.array("heads")) {
    if (heads->size() > kMaxCalibratedHeads) {
      return fail(Errc::kBadValue,
                  fmt::format("the calibration has more heads than it may have: 1 to {}", kMaxCalibratedHeads));
    }
    for (std::size_t i = 0; i < heads->size(); ++i) {
      calibration.heads.push_back(parse_head(Fields(&(*heads)[i], fmt::format("heads[{}]", i), error)));
    }
  }
  fields.done();
  if (error) return fail(*error);
  NODAL_TRY(check_calibration(calibration));
  return calibration;
}

}  // namespace nodal
