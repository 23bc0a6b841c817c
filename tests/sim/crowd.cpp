#include "tests/sim/crowd.h"

#include <malloc.h>

#include <algorithm>
#include <array>

namespace nodal::swarm {
namespace {

constexpr Duration kCountsLiveEvery = Duration::milliseconds(250);
constexpr std::size_t kNarrowLinkBytes = 512;      ///< a picture has 128 bytes here
constexpr std::uint64_t kUnknownBytes = 2U << 20;  ///< per hostile client; they also cost wall time

}  // namespace

std::uint64_t Crowd::live_bytes() {
  const struct mallinfo2 heap = mallinfo2();
  return heap.uordblks + heap.hblkhd;
}

Crowd::Crowd(hal::sim::SimLinkListener& listener, Oracle& oracle, Documents& documents, Tally& tally,
             std::uint64_t seed, firmware::Rig& rig, hal::sim::SimDisk& disk, Instant now)
    : oracle_(oracle),
      tally_(tally),
      listener_(listener),
      torn_(documents.json[0]),
      random_(seed, "crowd"),
      rig_(rig),
      disk_(disk),
      since_(now),
      live_before_(live_bytes()),
      lost_before_(sets_lost()),
      free_before_(*disk.free_bytes()),
      next_count_(now) {
  for (const bool visitor : {false, true}) {
    good_.push_back(std::make_unique<GoodClient>(listener, oracle, documents, tally, visitor, random_.next(), now));
  }
}

void Crowd::attack() {
  const auto drawn_kind = [&] { return static_cast<HostileKind>(random_.below(kHostileKinds)); };
  // They come from another user, from another process of the same user, or from the same process, as through ssh.
  constexpr std::array<hal::PeerIdentity, 3> kFrom = {{{2000, 815}, {1000, 815}, {1000, 4711}}};
  const hal::PeerIdentity from = kFrom[random_.below(kFrom.size())];
  const auto connect = [this, from](bool narrow) {
    auto link = listener_.connect(from);
    if (narrow) link->in().capacity = kNarrowLinkBytes;
    return link;
  };
  const bool all_alike = random_.chance(500'000);
  const HostileKind common = drawn_kind();
  const bool only_there =
      all_alike && (common == HostileKind::kSilent || common == HostileKind::kIdle || common == HostileKind::kHalfOpen);
  const int many = 1 + static_cast<int>(random_.below(only_there ? kMaxThatOnlyAreThere : kMaxHostile));
  for (int i = 0; i < many; ++i) {
    const HostileKind kind = all_alike ? common : drawn_kind();
    hostile_.push_back(std::make_unique<Hostile>(kind, connect, torn_, kUnknownBytes, random_.next()));
    ++tally_.hostile[static_cast<std::size_t>(kind)];
  }
  ++tally_.crowds;
  hostile_names_.clear();
  for (int i = 0; i < kHostileKinds; ++i) {
    const auto of_kind = [&](const auto& client) { return client->kind() == static_cast<HostileKind>(i); };
    const auto count = std::count_if(hostile_.begin(), hostile_.end(), of_kind);
    if (count == 0) continue;
    if (!hostile_names_.empty()) hostile_names_ += ", ";
    hostile_names_ += std::to_string(count) + " " + std::string(name_of(static_cast<HostileKind>(i)));
  }
}

void Crowd::act(Instant now) {
  for (const auto& client : hostile_) client->act(now);
  for (const auto& client : good_) client->pump(now);
}

void Crowd::on_news(const std::vector<std::string>& sentences) {
  constexpr std::uint64_t kLine = 33;  // time, level and end of line, in nodald's format
  for (const std::string& sentence : sentences) news_ += sentence.size() + kLine;
}

std::uint64_t Crowd::sets_lost() const {
  return rig_.control().sets_missed_by_blend() + rig_.blender().counts().without_buffer.load() +
         rig_.blender().counts().shed.load();
}

void Crowd::check(Instant now) {
  for (const auto& client : good_) client->check(now, hostile_names_);
  if (sets_lost() != lost_before_) {
    oracle_.fail(std::to_string(sets_lost() - lost_before_) + " sets are lost because of " + hostile_names_);
  }
  const auto seconds = static_cast<std::uint64_t>((now - since_).ms()) / 1000;
  if (news_ > kMaxNewsAtOnce + kMaxNewsAMinute * seconds / 60) {
    oracle_.fail(std::to_string(news_) + " bytes for the log in " + std::to_string(seconds) + " s, because of " +
                 hostile_names_);
  }
  const std::uint64_t free = *disk_.free_bytes();
  if (free + kMaxFileBytes < free_before_) {
    oracle_.fail("files grew by " + std::to_string((free_before_ - free) >> 10) + " KiB, because of " + hostile_names_);
  }
  if (now < next_count_) return;
  next_count_ = now + kCountsLiveEvery;
  const std::uint64_t live = live_bytes();
  const std::uint64_t more = live - std::min(live, live_before_);
  tally_.most_live = std::max(tally_.most_live, more);
  if (more > kMaxLiveBytes) {
    oracle_.fail("live memory grew by " + std::to_string(more >> 10) + " KiB, because of " + hostile_names_);
  }
}

void Crowd::leave() {
  hostile_.clear();
  good_.clear();
}

void Crowd::check_end() {
  const std::uint64_t live = live_bytes();
  const std::uint64_t more = live - std::min(live, live_before_);
  tally_.most_left = std::max(tally_.most_left, more);
  if (more <= kMaxLeftBytes) return;
  oracle_.fail(std::to_string(more >> 10) + " KiB more are live after " + hostile_names_ + " have gone");
}

}  // namespace nodal::swarm
