#include "stitch/table/tone_compiler.h"

#include <algorithm>
#include <cmath>

#include "stitch/geometry/response.h"

namespace nodal::table {
namespace {

constexpr double kPower = 2.2;  ///< makes curves nearly straight, so that few knots suffice
constexpr std::size_t kShownSteps = 1024;

bool is_power(const Response& response) {
  return response.curve == Response::Curve::kLinear || response.curve == Response::Curve::kGamma;
}

std::uint16_t sample(double part) {
  return static_cast<std::uint16_t>(std::lround(std::clamp(part, 0.0, 1.0) * blend::kMaxSample));
}

double gamma_of(const Response& response) { return response.curve == Response::Curve::kGamma ? response.gamma : 1; }

double light_at(const Response& response, double knot) {
  return geometry::decode(response, std::min(1.0, 1024 * knot / blend::kMaxSample));
}

/// The curve through the points at samples 1024 i; the last knot is chosen so that the value at kMaxSample is
/// kMaxSample.
template <class PartAt>
blend::ToneCurve curve_through(PartAt part_at) {
  blend::ToneCurve curve;
  const std::size_t last = curve.knots.size() - 1;
  for (std::size_t i = 0; i < last; ++i) curve.knots[i] = sample(part_at(static_cast<double>(i)));
  const int before = curve.knots[last - 1];
  const int within = blend::kMaxSample - 1024 * static_cast<int>(last - 1);
  curve.knots[last] = static_cast<std::uint16_t>(before + (blend::kMaxSample - before) * 1024 / within);
  return curve;
}

blend::ToneCurve to_power(const Response& response) {
  return curve_through([&](double knot) { return std::pow(light_at(response, knot), 1 / kPower); });
}

/// Chords between points of a curved function err to one side only. Shifting the knots by half of that error halves it.
blend::ToneCurve to_light(const Response& response) {
  const auto off = [&](double a, double b) {
    return (light_at(response, a) + light_at(response, b)) / 2 - light_at(response, (a + b) / 2);
  };
  constexpr double kEnd = static_cast<double>(blend::kMaxSample) / 1024;
  return curve_through([&](double knot) {
    if (knot == 0) return 0.0;
    return light_at(response, knot) - (off(knot - 1, knot) + off(knot, std::min(knot + 1, kEnd))) / 4;
  });
}

/// Light of an sRGB value (IEC 61966-2-1), continued above white.
double light_of_srgb(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

blend::ToneTable to_linear(const Calibration& calibration, bool soft) {
  blend::ToneTable table;
  table.soft = soft;
  const double power = linear_power(calibration);
  for (const HeadCalibration& head : calibration.heads) {
    blend::ToneTable::Head& made = table.heads.emplace_back();
    made.exponent = static_cast<std::uint16_t>(std::lround(32768 / std::max(0.5001, power)));
    if (!is_power(head.response) || gamma_of(head.response) != power) made.curve = to_light(head.response);
  }
  for (std::size_t level = 0; level <= blend::ToneTable::kShownLevels; ++level) {
    const double light = light_of_srgb(static_cast<double>(level) / 255);
    table.shown_light.push_back(static_cast<std::uint32_t>(std::lround(light * blend::ToneTable::kWhite)));
  }
  return table;
}

}  // namespace

double linear_power(const Calibration& calibration) {
  const Response& first = calibration.heads.front().response;
  const bool alike = std::all_of(calibration.heads.begin(), calibration.heads.end(), [&](const HeadCalibration& head) {
    return is_power(head.response) && gamma_of(head.response) == gamma_of(first);
  });
  return alike ? gamma_of(first) : 1;
}

std::vector<std::uint16_t> linear_numbers(double power) {
  std::vector<std::uint16_t> numbers(blend::kLinearSteps);
  for (std::size_t light = 0; light < numbers.size(); ++light) {
    const double part = std::min(1.0, static_cast<double>(light) / blend::kMaxSample);
    numbers[light] = static_cast<std::uint16_t>(std::lround(65535 * std::pow(part, power)));
  }
  return numbers;
}

blend::ToneTable compile_tone_table(const Calibration& calibration, PixelFormat raymap, bool soft) {
  if (is_linear16(raymap)) return to_linear(calibration, soft);
  blend::ToneTable table;
  table.soft = soft;
  const bool powers = std::all_of(calibration.heads.begin(), calibration.heads.end(),
                                  [](const HeadCalibration& head) { return is_power(head.response); });
  for (const HeadCalibration& head : calibration.heads) {
    blend::ToneTable::Head& made = table.heads.emplace_back();
    // A gamma below 1 would need an exponent above 1, which does not fit: it is clamped instead of wrapping around.
    made.exponent =
        static_cast<std::uint16_t>(std::lround(32768 / std::max(0.5001, powers ? gamma_of(head.response) : kPower)));
    if (!powers) made.curve = to_power(head.response);
  }
  if (powers) return table;
  const Response& response = calibration.heads.front().response;
  for (std::size_t i = 0; i <= kShownSteps; ++i) {
    const double light = std::pow(static_cast<double>(i) / kShownSteps, kPower);
    table.shown.push_back(static_cast<std::int16_t>(sample(geometry::encode(response, light))));
  }
  return table;
}

}  // namespace nodal::table
