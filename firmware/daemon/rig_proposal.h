// Chooses modes for the devices that a scan found, as the heads of a first rig.toml.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "hal/linux/v4l2/scan.h"

namespace nodal::daemon {

struct ProposedHead {
  std::size_t device = 0;  ///< index in the scan
  std::string name;        ///< "cam0"
  PixelFormat format = PixelFormat::kI420;
  int width = 0;
  int height = 0;
  std::int64_t bytes_per_second = 0;
};

struct RigProposal {
  FrameRate rate;
  PixelFormat raymap_format = PixelFormat::kI420;
  std::vector<ProposedHead> heads;
  std::map<std::size_t, std::string> left_out;  ///< devices that are no heads, by index: the reason
};

/// One rate for all heads: that at which most devices have a mode, then the nearest to 30 frames a second. Of each
/// device, the largest size up to 1920x1080; while a USB bus cannot carry its heads, the one with most bytes per second
/// gets a smaller size.
RigProposal propose_rig(const std::vector<hal::v4l2::FoundDevice>& devices);

/// Where the proposed rig has its files; empty: where nodald has them by default.
struct RigPlaces {
  std::string socket;  ///< control socket
  std::string folder;  ///< calibrations, settings and takes
};
/// Those of root: by default. Those of an ordinary user: user_rig_folder().
RigPlaces places_of_this_user();

/// The proposal as a rig.toml. One without heads is refused by `--check`.
std::string rig_toml(const RigProposal& proposal, const std::vector<hal::v4l2::FoundDevice>& devices,
                     const RigPlaces& places);

/// "30" or "30000/1001".
std::string rate_text(FrameRate rate);

}  // namespace nodal::daemon
