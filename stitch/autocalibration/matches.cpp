#include "stitch/autocalibration/matches.h"

#include <cmath>
#include <cstdint>
#include <limits>

namespace nodal::autocalibration {
namespace {

constexpr double kRatio = 0.8;  // largest ratio of the nearest distance to the second nearest, as in Lowe's paper
// Distance of descriptors whose norm is 512; two pictures of the same thing are mostly closer.
constexpr std::int32_t kSameDescriptor = 150;
constexpr double kPrevails = 0.15;  // share of ambiguous features above which repetition prevails

// The loop is compiled for wider registers, too; the arithmetic is integer, so the result is the same.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__) && !defined(NODAL_COVERAGE)
__attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#endif
std::int32_t
square_distance(const std::uint8_t* a, const std::uint8_t* b) {
  std::int32_t sum = 0;
  for (std::size_t i = 0; i < kDescriptorSize; ++i) {
    const std::int32_t difference = std::int32_t{a[i]} - std::int32_t{b[i]};
    sum += difference * difference;
  }
  return sum;
}

struct Nearest {
  std::size_t index = 0;
  std::int32_t first = std::numeric_limits<std::int32_t>::max();
  std::int32_t second = std::numeric_limits<std::int32_t>::max();

  void offer(std::size_t i, std::int32_t distance) {
    if (distance < first) {
      second = first;
      first = distance;
      index = i;
    } else if (distance < second) {
      second = distance;
    }
  }
  bool clear() const {
    return static_cast<double>(first) < kRatio * kRatio * static_cast<double>(second) &&
           second != std::numeric_limits<std::int32_t>::max();
  }
};

}  // namespace

bool Repetition::prevails() const { return static_cast<double>(ambiguous) > kPrevails * static_cast<double>(features); }

std::vector<Match> find_matches(std::size_t a, const std::vector<Feature>& in_a, std::size_t b,
                                const std::vector<Feature>& in_b, Repetition* repetition) {
  std::vector<Nearest> of_a(in_a.size()), of_b(in_b.size());
  for (std::size_t i = 0; i < in_a.size(); ++i) {
    for (std::size_t j = 0; j < in_b.size(); ++j) {
      const std::int32_t distance = square_distance(in_a[i].descriptor.data(), in_b[j].descriptor.data());
      of_a[i].offer(j, distance);
      of_b[j].offer(i, distance);
    }
  }
  for (std::size_t i = 0; repetition != nullptr && i < in_a.size(); ++i) {
    ++repetition->features;
    repetition->ambiguous += of_a[i].first < kSameDescriptor * kSameDescriptor && !of_a[i].clear() ? 1 : 0;
  }
  std::vector<Match> matches;
  for (std::size_t i = 0; i < in_a.size(); ++i) {
    const std::size_t j = of_a[i].index;
    if (in_b.empty() || !of_a[i].clear() || of_b[j].index != i) continue;
    matches.push_back({a, b, in_a[i].pixel, in_b[j].pixel,
                       std::sqrt((in_a[i].scale * in_a[i].scale + in_b[j].scale * in_b[j].scale) / 2)});
  }
  return matches;
}

}  // namespace nodal::autocalibration
