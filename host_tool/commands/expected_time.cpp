#include "host_tool/commands/expected_time.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace nodal::host {
namespace {

constexpr double kPerCalibrated = 6, kPerRegistered = 1.2;  // s
constexpr double kPerMegapixel = 2.2;                       // s, of the sphere
constexpr double kSerial = 0.4;                             // share of the work that one core does alone
constexpr double kWorthSaying = 10;                         // s

}  // namespace

std::string expected_time(const ExpectedWork& work, unsigned cores) {
  const double processor = kPerCalibrated * static_cast<double>(work.calibrated) +
                           kPerRegistered * static_cast<double>(work.registered) +
                           kPerMegapixel * work.blended_px / 1e6;
  const double seconds = processor * (kSerial + (1 - kSerial) / std::max(1U, cores));
  if (!(seconds > kWorthSaying)) return "";
  if (seconds < 55) return fmt::format("this takes about {:.0f} s on this computer", 10 * std::ceil(seconds / 10));
  const double minutes = std::ceil(seconds / 60 - 0.1);
  return fmt::format("this takes about {} on this computer",
                     minutes == 1 ? "a minute" : fmt::format("{:.0f} minutes", minutes));
}

}  // namespace nodal::host
