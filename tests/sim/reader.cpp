#include "tests/sim/reader.h"

#include <utility>

namespace nodal::swarm {
namespace {

firmware::OutletSpec draw_spec(hal::sim::Random& random, std::string_view name) {
  const bool latest = random.chance(500'000);
  return {name, latest ? firmware::OutletPolicy::kLatest : firmware::OutletPolicy::kLossless,
          static_cast<std::size_t>(1 + random.below(3)), static_cast<std::size_t>(1 + random.below(2))};
}

}  // namespace

ReaderNature draw_reader(hal::sim::Random& random) {
  const firmware::OutletSpec sets = draw_spec(random, "reader of sets");
  return {sets, draw_spec(random, "reader of raymaps")};
}

SecondReader::SecondReader(firmware::Rig& rig, const ReaderNature& nature, std::uint64_t seed)
    : rig_(rig), random_(seed, "second reader") {
  sets_.outlet = &rig.capture().add_outlet(nature.sets);
  raymaps_.outlet = &rig.encoder().add_outlet(nature.raymaps);
}

/// First it keeps up, then it is slow, then stuck, and again.
void SecondReader::change_pace(Instant now) {
  if (now < pace_until_) return;
  pace_ = static_cast<Pace>((static_cast<unsigned>(pace_) + 1) % 3);
  pace_until_ = now + Duration::milliseconds(static_cast<std::int64_t>(1000 + random_.below(20'000)));
}

std::optional<std::string> SecondReader::step(Instant now) {
  change_pace(now);
  const auto up_to = [&](Duration most) {
    return Duration::nanoseconds(static_cast<std::int64_t>(random_.below(static_cast<std::uint64_t>(most.ns()))));
  };
  if (now >= next_set_) {
    const Pace pace = pace_ == Pace::kKeepsUp ? pace_ : Pace::kSlow;
    next_set_ = pace == Pace::kSlow ? now + up_to(kSetHeld) : now;
    auto wrong =
        read(sets_, pace, rig_.capture().report().sets, [](const firmware::SetLoan& set) { return set->number; });
    if (wrong) return wrong;
  }
  if (now >= next_raymap_) {
    next_raymap_ = pace_ == Pace::kSlow ? now + up_to(Duration::seconds(1)) : now;
    auto wrong = read(raymaps_, pace_, rig_.encoder().steps(), [](const firmware::Raymap& raymap) {
      return 2 * raymap.info.set + (raymap.info.field ? raymap.info.field->number : 0);
    });
    if (wrong) return wrong;
  }
  if (const std::uint64_t missed = rig_.encoder().published().losses().full; missed > 0) {
    return "the publisher missed " + std::to_string(missed) + " raymaps beside a second reader";
  }
  if (rig_.blender().counts().blended.load() != rig_.encoder().steps() && !rig_.encoder().published().full()) {
    return "a raymap is blended and not published, although the publisher has room";
  }
  return std::nullopt;
}

template <class Item, class NumberOf>
std::optional<std::string> SecondReader::read(Reading<Item>& from, Pace pace, std::uint64_t offered,
                                              NumberOf number_of) {
  const firmware::OutletSpec& spec = from.outlet->spec();
  if (pace != Pace::kStuck) from.held.clear();
  while (from.held.size() < spec.reading) {
    auto item = from.outlet->take();
    if (!item) break;
    const std::uint64_t number = number_of(*item);
    if (from.newest && number <= *from.newest) return std::string(spec.name) + " was given one out of order";
    from.newest = number;
    ++from.read;
    from.held.push_back(std::move(*item));
    if (pace == Pace::kKeepsUp) from.held.clear();
  }
  const firmware::OutletLosses losses = from.outlet->losses();
  const std::uint64_t known = from.read + losses.full + losses.replaced;
  if (known > offered || offered - known > spec.waiting) {
    return std::string(spec.name) + ": of " + std::to_string(offered) + ", " + std::to_string(from.read) +
           " were read, " + std::to_string(losses.full) + " and " + std::to_string(losses.replaced) +
           " missed, and no more than " + std::to_string(spec.waiting) + " can wait";
  }
  return std::nullopt;
}

}  // namespace nodal::swarm
