// Rigs that can be reached: those on USB cables, and those that announce their page in the network (mDNS).
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/base/units.h"

namespace nodal::host {

/// Its texts are claims of whoever announces it.
struct FoundRig {
  std::string name;
  std::string address;  ///< as --rig takes it
  std::string page;     ///< https address of the page for phones; empty: none
};

/// The type of service that `nodal-web front enable` announces.
inline constexpr const char* kRigService = "_nodal._tcp";
inline constexpr std::size_t kMaxAnnouncedRigs = 64;
inline constexpr std::size_t kMaxAnnouncements = 256 << 10;  ///< bytes of avahi-browse's output

/// The rigs in the output of `avahi-browse --resolve --parsable`, each once, an IPv4 address before others. Whatever is
/// malformed, and what is beyond kMaxAnnouncedRigs, is left out.
std::vector<FoundRig> announced_rigs(std::string_view text);

struct FoundRigs {
  std::vector<FoundRig> rigs;
  std::vector<std::string> notes;  ///< where no rigs could be searched for, and why
};
/// Reads the list of USB devices and runs avahi-browse for at most so long.
FoundRigs find_rigs(Duration at_most);

}  // namespace nodal::host
