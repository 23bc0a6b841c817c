#include "stitch/table/tone_compiler.h"

#include <algorithm>
#include <cmath>

#include "stitch/geometry/response.h"

namespace nodal::table {
namespace {

constexpr double kPower = 2.2;  ///< curves are then nearly straight, which few knots suffice for
constexpr std::size_t kShownSteps = 1024;

bool is_power(const Response& response) {
  return response.curve == Response::Curve::kLinear || response.curve == Response::Curve::kGamma;
}

std::int16_t sample(double part) {
  return static_cast<std::int16_t>(std::lround(std::clamp(part, 0.0, 1.0) * blend::kMaxSample));
}

blend::ToneCurve to_power(const Response& response) {
  blend::ToneCurve curve;
  for (std::size_t i = 0; i < curve.knots.size(); ++i) {
    const double encoded = std::min(1.0, 1024.0 * static_cast<double>(i) / blend::kMaxSample);
    curve.knots[i] = sample(std::pow(geometry::decode(response, encoded), 1 / kPower));
  }
  return curve;
}

}  // namespace

blend::ToneTable compile_tone_table(const Calibration& calibration, bool soft) {
  blend::ToneTable table;
  table.soft = soft;
  const bool powers = std::all_of(calibration.heads.begin(), calibration.heads.end(),
                                  [](const HeadCalibration& head) { return is_power(head.response); });
  for (const HeadCalibration& head : calibration.heads) {
    blend::ToneTable::Head& made = table.heads.emplace_back();
    const double own = head.response.curve == Response::Curve::kGamma ? head.response.gamma : 1;
    // A gamma below one would be an exponent above it; none is in use, and a bent one is better than a wrapped one.
    made.exponent = static_cast<std::uint16_t>(std::lround(32768 / std::max(0.5001, powers ? own : kPower)));
    if (!powers) made.curve = to_power(head.response);
  }
  if (powers) return table;
  const Response& response = calibration.heads.front().response;
  for (std::size_t i = 0; i <= kShownSteps; ++i) {
    const double light = std::pow(static_cast<double>(i) / kShownSteps, kPower);
    table.shown.push_back(sample(geometry::encode(response, light)));
  }
  return table;
}

}  // namespace nodal::table
