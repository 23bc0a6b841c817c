#include "host_tool/commands/expected_time.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <thread>

namespace nodal::host {
namespace {

// Processor time, s:
constexpr double kPerPicture = 0.5;              // each that is placed,
constexpr double kPerPictureMegapixel = 0.7;     // the same, up to kLargestPicture
constexpr double kPerMegapixel = 2.2;            // the sphere
constexpr double kPerRegisteredMegapixel = 1.8;  // each picture that is registered, up to kLargestPicture
constexpr double kLargestPicture = 1.7;          // megapixels in which features are found
constexpr double kSerial = 0.3;                  // share of the work that one core does alone
constexpr double kWorthSaying = 10;              // s

}  // namespace

ExpectedWork registration_of(RigPictures& rig, bool alone) {
  if (rig.sets.empty() || rig.sets.front().empty()) return {};
  const std::size_t heads = rig.sets.front().size();
  return {.placed = alone ? heads : 0,
          .picture_px = pixels_of(rig.sets.front().front()),
          .registered = heads * (alone ? 1 : rig.sets.size())};
}

void say_time(Console& console, const ExpectedWork& work) {
  const std::string time = expected_time(work, std::thread::hardware_concurrency());
  if (!time.empty()) console.note(time);
}

double pixels_of(HeadPicture& picture) {
  const Result<ImageHeader> header = picture.header();
  return header ? static_cast<double>(header->width) * header->height : 0;
}

std::string expected_time(const ExpectedWork& work, unsigned cores) {
  const double megapixels = std::min(work.picture_px / 1e6, kLargestPicture);
  const double processor = static_cast<double>(work.placed) * (kPerPicture + kPerPictureMegapixel * megapixels) +
                           kPerMegapixel * work.blended_px / 1e6 +
                           kPerRegisteredMegapixel * static_cast<double>(work.registered) * megapixels;
  const double seconds = processor * (kSerial + (1 - kSerial) / std::max(1U, cores));
  if (!(seconds > kWorthSaying)) return "";
  if (seconds < 55) return fmt::format("this takes about {:.0f} s on this computer", 10 * std::ceil(seconds / 10));
  const double minutes = std::ceil(seconds / 60 - 0.1);
  return fmt::format("this takes about {} on this computer",
                     minutes == 1 ? "a minute" : fmt::format("{:.0f} minutes", minutes));
}

}  // namespace nodal::host
