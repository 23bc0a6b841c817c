#include "tests/sim/reader.h"

#include <utility>

namespace nodal::swarm {

firmware::OutletSpec draw_reader(hal::sim::Random& random) {
  const bool latest = random.chance(500'000);
  return {"second reader", latest ? firmware::OutletPolicy::kLatest : firmware::OutletPolicy::kLossless,
          static_cast<std::size_t>(1 + random.below(3)), static_cast<std::size_t>(1 + random.below(2))};
}

SecondReader::SecondReader(firmware::Rig& rig, const firmware::OutletSpec& spec, std::uint64_t seed)
    : rig_(rig), random_(seed, "second reader"), outlet_(rig.encoder().add_outlet(spec)) {}

/// Alternates: in step, slow, stuck.
void SecondReader::change_pace(Instant now) {
  if (now < pace_until_) return;
  pace_ = static_cast<Pace>((static_cast<unsigned>(pace_) + 1) % 3);
  pace_until_ = now + Duration::milliseconds(static_cast<std::int64_t>(1000 + random_.below(20'000)));
}

std::optional<std::string> SecondReader::step(Instant now) {
  change_pace(now);
  if (now >= next_read_) {
    next_read_ = now;
    if (pace_ == Pace::kSlow) {
      next_read_ = now + Duration::milliseconds(static_cast<std::int64_t>(random_.below(1000)));
    }
    if (auto wrong = read()) return wrong;
  }
  if (const std::uint64_t missed = rig_.encoder().published().losses().full; missed > 0) {
    return "the publisher missed " + std::to_string(missed) + " raymaps beside a second reader";
  }
  if (rig_.blender().counts().blended.load() != rig_.encoder().steps() && !rig_.encoder().published().full()) {
    return "a raymap is blended and not published, although the publisher has room";
  }
  return std::nullopt;
}

std::optional<std::string> SecondReader::read() {
  if (pace_ != Pace::kStuck) held_.clear();
  while (held_.size() < outlet_.spec().reading) {
    auto raymap = outlet_.take();
    if (!raymap) break;
    const std::uint64_t number = 2 * raymap->info.set + (raymap->info.field ? raymap->info.field->number : 0);
    if (newest_ && number <= *newest_) return "the second reader was given a raymap out of order";
    newest_ = number;
    ++read_;
    held_.push_back(std::move(*raymap));
    if (pace_ == Pace::kKeepsUp) held_.clear();
  }
  const std::uint64_t offered = rig_.encoder().steps();
  const firmware::OutletLosses losses = outlet_.losses();
  const std::uint64_t known = read_ + losses.full + losses.replaced;
  if (known <= offered && offered - known <= outlet_.spec().waiting) return std::nullopt;
  return "the second reader: of " + std::to_string(offered) + " raymaps, " + std::to_string(read_) + " were read, " +
         std::to_string(losses.full) + " and " + std::to_string(losses.replaced) + " missed, and no more than " +
         std::to_string(outlet_.spec().waiting) + " can wait";
}

}  // namespace nodal::swarm
