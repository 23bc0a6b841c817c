// A take as the list of takes shows it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/gaps.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"

namespace nodal::take {
struct Manifest;
}

namespace nodal::firmware {

enum class TakeState : std::uint8_t {
  kRecording,
  kComplete,    ///< it has a manifest
  kUnfinished,  ///< it is recovered when its turn comes, or TakeEntry::problem says why not
  kDamaged,     ///< it could not be recovered: TakeEntry::problem
  kSetAside,    ///< its recovery failed twice; it stays as it is
};
std::string_view take_state_name(TakeState state);

struct TakeEntry {
  std::uint64_t number = 0;
  TakeState state = TakeState::kComplete;
  std::int64_t started_utc_ns = 0;
  std::uint64_t sets = 0;
  std::uint64_t lost_sets = 0;
  std::uint64_t deleted_sets = 0;  ///< to make room for newer ones
  take::Gaps gaps{};
  std::vector<take::HeadGaps> heads{};  ///< by index
  /// Rate of its first sets (nothing: unknown), and how many rates there were: a manifest may list kMaxRates, but an
  /// entry keeps only one.
  std::optional<FrameRate> rate{};
  std::size_t rates = 0;
  std::uint64_t bytes = 0;
  Duration length;
  bool is_protected = false;
  std::string ended;
  std::string problem;
  int raymap_width = 0;  ///< px; 0 without raymaps
  int raymap_height = 0;
  bool all_near_marks = false;  ///< nothing of it may be deleted to make room
  std::uint64_t version = 0;    ///< version of the take's folder (hal::FolderEntry) when this entry was read

  void complete(const take::Manifest& manifest);
  void set_damaged(const Error& why);
};

}  // namespace nodal::firmware
