#include "firmware/capture/exposure.h"

#include <algorithm>
#include <cstdlib>

#include "protocol/base/result.h"

namespace nodal::firmware {
namespace {

using Distances = std::array<std::array<int, kMaxHeads>, kMaxHeads>;
constexpr int kUnconnected = 1 << 10;

/// The shortest path between any two heads, in overlaps (Floyd-Warshall).
Distances distances_of(const blend::SphereLight& seen, HeadMask present) {
  Distances apart;
  constexpr std::size_t heads = kMaxHeads;
  for (std::size_t i = 0; i < heads; ++i) {
    for (std::size_t j = 0; j < heads; ++j) {
      const bool touch =
          (seen.heads[i].overlaps & head_bit(j)) != 0 && (present & head_bit(i)) != 0 && (present & head_bit(j)) != 0;
      apart[i][j] = i == j ? 0 : touch ? 1 : kUnconnected;
    }
  }
  for (std::size_t k = 0; k < heads; ++k) {
    for (std::size_t i = 0; i < heads; ++i) {
      for (std::size_t j = 0; j < heads; ++j) apart[i][j] = std::min(apart[i][j], apart[i][k] + apart[k][j]);
    }
  }
  return apart;
}

/// How far an exposure moves in one set, from the size of its error.
Stops stride(Stops error, Stops ramp) {
  const Stops size = std::abs(error);
  Stops wanted = size;  // an error above one stop comes from a sudden change of light, so the exposure may jump as well
  if (size <= kStop) wanted = std::max(size / 2, ExposureControl::kStep);
  if (size <= ExposureControl::kNear) wanted = std::min(size, ExposureControl::kStep);
  return std::min(wanted, std::max<Stops>(ramp, 1));
}

}  // namespace

std::pair<Stops, Stops> reach(const ExposureRange& range) {
  return {stops_of(range.shortest) + stops_of(range.lowest), stops_of(range.longest) + stops_of(range.highest)};
}

ExposureOrder split(Stops stops, const ExposureRange& range) {
  const auto [low, high] = reach(range);
  const Stops wanted = std::clamp(stops, low, high);
  const Stops shutter = std::min(wanted - stops_of(range.lowest), stops_of(range.longest));
  const auto us = static_cast<std::int64_t>(exp2_stops(std::max<Stops>(shutter, 0)));
  // Rounded down to a whole microsecond, so that the gain has to supply a rest that is not negative.
  ExposureOrder order;
  order.exposure = std::clamp(Exposure::microseconds(us), range.shortest, range.longest);
  if (stops_of(order.exposure) > shutter && us > 1) {
    order.exposure = std::clamp(Exposure::microseconds(us - 1), range.shortest, range.longest);
  }
  order.gain = std::clamp(gain_of(wanted - stops_of(order.exposure)), range.lowest, range.highest);
  return order;
}

void ExposureControl::set(const ExposureSettings& settings) {
  NODAL_ASSERT(!settings.anchor || *settings.anchor < kMaxHeads);
  report_.settings = settings;
  report_.settled = false;
  resting_ = 0;
  for (auto& requested : requested_) requested.reset();
}

ExposureControl::Orders ExposureControl::step(const blend::SphereLight& seen,
                                              std::span<const std::optional<ExposureRange>, kMaxHeads> ranges) {
  Orders orders;
  report_.seen = seen;
  ++report_.sets;
  HeadMask present = 0;
  for (std::size_t h = 0; h < kMaxHeads; ++h) {
    if (seen.heads[h].solid_angle > 0 && ranges[h]) present |= head_bit(h);
  }
  find_goals(present);
  const ExposureSettings& settings = report_.settings;
  if (settings.program == ExposureProgram::kManual || settings.locked || present == 0) return orders;

  std::array<Stops, kMaxHeads> errors{};
  Stops worst = 0;
  report_.settled = true;
  for (std::size_t h = 0; h < kMaxHeads; ++h) {
    if ((present & head_bit(h)) == 0) continue;
    const auto [low, high] = reach(*ranges[h]);
    report_.goal[h] = std::clamp(report_.goal[h], low, high);
    if (!requested_[h]) requested_[h] = std::clamp(seen.heads[h].exposure, low, high);
    errors[h] = report_.goal[h] - *requested_[h];
    const Stops size = std::abs(errors[h]);
    report_.settled = report_.settled && size <= kNear;
    if (size > kRest) resting_ &= ~head_bit(h);
    if (size < kStep) resting_ |= head_bit(h);
    worst = std::max(worst, (resting_ & head_bit(h)) != 0 ? 0 : size);
  }
  if (worst == 0) return orders;
  const bool together = settings.program == ExposureProgram::kJoint;
  const std::int64_t common = stride(worst, settings.ramp);
  for (std::size_t h = 0; h < kMaxHeads; ++h) {
    if (errors[h] == 0) continue;  // as of every absent head
    if (!together && (resting_ & head_bit(h)) != 0) continue;
    const Stops own = errors[h] < 0 ? -stride(errors[h], settings.ramp) : stride(errors[h], settings.ramp);
    const Stops move = together ? static_cast<Stops>(std::min(common, std::int64_t{worst}) * errors[h] / worst) : own;
    if (move == 0) continue;
    *requested_[h] += std::abs(move) > std::abs(errors[h]) ? errors[h] : move;
    orders.of[h] = split(*requested_[h], *ranges[h]);
    orders.heads |= head_bit(h);
  }
  return orders;
}

void ExposureControl::find_goals(HeadMask present) {
  for (std::size_t h = 0; h < kMaxHeads; ++h) {
    report_.goal[h] = report_.settings.target - report_.seen.heads[h].light;
  }
  if (report_.settings.program == ExposureProgram::kJoint) limit_differences(present);
}

/// Changes the goals so that overlapping heads differ by at most `difference`: each goal becomes the mean of two, the
/// largest allowed ones below all original goals and the smallest allowed ones above them. Then, without an anchor, all
/// goals are shifted so that the mean exposure of the sphere does not change. With an anchor, the anchor's goal does
/// not change.
void ExposureControl::limit_differences(HeadMask present) {
  const Distances apart = distances_of(report_.seen, present);
  constexpr std::size_t heads = kMaxHeads;
  const Stops step = report_.settings.difference;
  auto& goal = report_.goal;
  const auto anchor = report_.settings.anchor;
  const bool anchored = anchor && (present & head_bit(*anchor)) != 0;
  for (std::size_t i = 0; anchored && i < heads; ++i) {
    if (apart[i][*anchor] >= kUnconnected) continue;
    const Stops most = step * apart[i][*anchor];
    goal[i] = std::clamp(goal[i], goal[*anchor] - most, goal[*anchor] + most);
  }
  std::array<Stops, kMaxHeads> limited{};
  std::int64_t before = 0;
  std::int64_t after = 0;
  std::int64_t all = 0;
  for (std::size_t i = 0; i < heads; ++i) {
    if ((present & head_bit(i)) == 0) continue;
    Stops below = goal[i];
    Stops above = goal[i];
    for (std::size_t j = 0; j < heads; ++j) {
      if ((present & head_bit(j)) == 0 || apart[i][j] >= kUnconnected) continue;
      below = std::min(below, goal[j] + step * apart[i][j]);
      above = std::max(above, goal[j] - step * apart[i][j]);
    }
    limited[i] = below + (above - below) / 2;
    const auto weight = static_cast<std::int64_t>(report_.seen.heads[i].solid_angle);
    before += goal[i] * weight;
    after += limited[i] * weight;
    all += weight;
  }
  const auto shift = anchored || all == 0 ? Stops{0} : static_cast<Stops>((before - after) / all);
  for (std::size_t i = 0; i < heads; ++i) {
    if ((present & head_bit(i)) != 0) goal[i] = limited[i] + shift;
  }
}

}  // namespace nodal::firmware
