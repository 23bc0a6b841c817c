// A host that sends requests, uploads, pulls and genlocks, over a link with any faults.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hal/sim/link.h"
#include "hal/sim/scene/random.h"
#include "protocol/upload.h"
#include "tests/sim/draw.h"
#include "tests/sim/line.h"
#include "tests/sim/oracle.h"

namespace nodal::swarm {

/// The hosts' calibrations, and what is known about the one that the rig must have.
struct Documents {
  std::array<std::string, kCalibrations> json;
  std::array<Sha256, kCalibrations> id;
  std::optional<int> sure;                  ///< the calibration that the rig says is in force
  std::array<bool, kCalibrations> maybe{};  ///< calibrations that were requested since
};

/// Threading: thread-bound.
/// Ownership: refers to its arguments.
/// Errors: the rig's answers are traced; forbidden answers are reported to the oracle.
class Host {
 public:
  Host(hal::sim::SimLinkListener& listener, Oracle& oracle, Documents& documents, Tally& tally, std::uint64_t seed)
      : Host(listener.connect(), oracle, documents, tally, seed) {}

  /// Does one random action.
  void act();
  void genlock(bool start);
  /// Reads available bytes and writes pending ones.
  void pump();
  bool dead() const { return line_.dead(); }

  // The link's faults.
  void split(std::uint32_t bytes);
  void reset() { link_.reset(); }
  void stall(bool stalled);
  void flip_bit();
  void replay();
  /// Disconnects during an upload.
  void leave_mid_upload();

 private:
  Host(std::unique_ptr<hal::sim::SimLink> link, Oracle& oracle, Documents& documents, Tally& tally, std::uint64_t seed);
  struct Open {
    std::optional<int> upload_to_begin, upload_to_commit;  ///< index of the document
  };
  void send(wire::Request request, Open open = {});
  void handle(const wire::Reply& reply);
  void send_document(int which, std::uint64_t offset);
  void commit_when_sent();

  hal::sim::SimLink& link_;  ///< owned by the line
  Line line_;
  Oracle& oracle_;
  Documents& documents_;
  Tally& tally_;
  hal::sim::Random random_;
  std::map<std::uint64_t, Open> open_;
  std::uint64_t next_id_ = 1;
  struct Sending {
    int which = 0;
    StreamId stream = 0;
  };
  std::optional<Sending> sending_;
  wire::RaymapHeader raymap_;
  std::vector<std::uint8_t> pixels_;
};

}  // namespace nodal::swarm
