#include "firmware/hosts/fair_queue.h"

#include <algorithm>
#include <tuple>

namespace nodal::firmware {

namespace {

template <class Key>
std::uint64_t last_turn(const std::map<Key, std::uint64_t>& turns, const Key& key) {
  const auto found = turns.find(key);
  return found == turns.end() ? 0 : found->second;
}

/// Forgets the oldest turn when there are too many.
template <class Key>
void note_turn(std::map<Key, std::uint64_t>& turns, const Key& key, std::uint64_t turn) {
  turns[key] = turn;
  if (turns.size() <= FairQueue::kMaxParties) return;
  turns.erase(std::ranges::min_element(turns, {}, [](const auto& each) { return each.second; }));
}

}  // namespace

FairQueue::Party FairQueue::party_of(const Entry& entry) {
  const auto& identity = entry.host.identity;
  return {entry.host.access, identity ? std::optional(identity->user) : std::nullopt};
}

FairQueue::Process FairQueue::process_of(const Entry& entry) {
  return {party_of(entry), entry.host.identity ? entry.host.identity->process : 0};
}

void FairQueue::add(const Host& host) {
  NODAL_ASSERT(!waits(host.number));
  NODAL_ASSERT(waiting_.size() < kMaxWaiting);
  waiting_.push_back({host});
}

/// Index of the entry whose turn it is.
std::size_t FairQueue::choose() const {
  const auto starving = std::ranges::find_if(waiting_, [](const Entry& entry) { return entry.passed >= kMaxPassed; });
  if (starving != waiting_.end()) return static_cast<std::size_t>(starving - waiting_.begin());
  const auto rank = [this](const Entry& entry) {
    return std::tuple(-static_cast<int>(entry.host.access), last_turn(served_, party_of(entry)),
                      last_turn(served_processes_, process_of(entry)));
  };
  // The first of equal ranks, which is the one that arrived first.
  const auto first = std::ranges::min_element(waiting_, {}, rank);
  return static_cast<std::size_t>(first - waiting_.begin());
}

std::optional<std::uint64_t> FairQueue::next() {
  if (waiting_.empty()) return std::nullopt;
  const std::size_t chosen = choose();
  for (std::size_t i = 0; i < chosen; ++i) ++waiting_[i].passed;
  const Entry entry = waiting_[chosen];
  waiting_.erase(waiting_.begin() + static_cast<std::ptrdiff_t>(chosen));
  ++turns_;
  note_turn(served_, party_of(entry), turns_);
  note_turn(served_processes_, process_of(entry), turns_);
  return entry.host.number;
}

void FairQueue::leave(std::uint64_t host) {
  std::erase_if(waiting_, [&](const Entry& entry) { return entry.host.number == host; });
}

bool FairQueue::waits(std::uint64_t host) const {
  return std::ranges::any_of(waiting_, [&](const Entry& entry) { return entry.host.number == host; });
}

std::optional<Access> FairQueue::highest() const {
  std::optional<Access> highest;
  for (const Entry& entry : waiting_) highest = std::max(highest.value_or(Access::kView), entry.host.access);
  return highest;
}

}  // namespace nodal::firmware
