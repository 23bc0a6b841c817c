// Answers hosts that ask what is plugged into the board.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "firmware/hosts/client.h"
#include "firmware/hosts/device_scan.h"
#include "firmware/hosts/replies.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// One scan answers all hosts that asked since it began.
///
/// Threading: thread-bound to control.
/// Ownership: the scan outlives it.
/// Errors: ask()'s; those of the scan are sent to the hosts.
class DeviceListing {
 public:
  /// `scan`: null if the rig cannot list devices.
  explicit DeviceListing(DeviceScan* scan) : scan_(scan) {}

  bool available() const { return scan_ != nullptr; }
  /// Starts a scan; step() sends the answer. Call it only if available().
  void ask(Client& client, std::uint64_t request);
  /// Sends the answer of a scan that has ended. True when it did something.
  bool step(const Clients& clients, const Replies& replies, Instant now);
  void leave(std::uint64_t host);

 private:
  struct Waiting {
    std::uint64_t client = 0;
    std::uint64_t request = 0;  ///< id of the request
  };
  DeviceScan* const scan_;
  std::vector<Waiting> waiting_;
};

}  // namespace nodal::firmware
