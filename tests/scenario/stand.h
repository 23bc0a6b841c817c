// A whole rig on simulated ports in virtual time, on one thread, and hosts that talk to it.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "firmware/rig.h"
#include "hal/sim/clock.h"
#include "hal/sim/disk.h"
#include "hal/sim/link.h"
#include "hal/sim/pin.h"
#include "hal/sim/rig.h"
#include "hal/sim/watchdog.h"
#include "protocol/session.h"
#include "protocol/upload.h"
#include "tests/scenario/small_rig.h"

namespace nodal::scenario {

class Stand;

/// A raymap as received by a host.
struct Pulled {
  wire::RaymapHeader header;
  std::string meta;  ///< the header, serialized
  std::vector<std::uint8_t> body;
};

/// A host at the other end of a simulated link.
class TestHost {
 public:
  TestHost(Stand& stand, hal::sim::SimLinkListener& listener, hal::PeerIdentity who = {1000, 4711});

  /// Sends a request and runs the stand until the answer arrives. Sets the request's id.
  wire::Reply ask(wire::Request request);
  /// Sends a request without waiting; returns its id.
  std::uint64_t post(wire::Request request);
  const wire::Reply* reply(std::uint64_t id) const;

  wire::RigStatus status();
  wire::Heads heads();
  /// Begins, sends and commits.
  wire::Reply upload(const std::string& document);
  /// Begins and sends, without a commit; returns the offset that the rig reported.
  std::uint64_t send_document(const std::string& document);
  /// Starts a pull; returns its stream, or 0 if it was refused (see `refusal`).
  StreamId pull(bool jpeg, std::uint64_t count, bool lossless = false);

  void pump();
  hal::sim::SimLink& link() { return *link_; }
  Session& session() { return session_; }
  bool dead() const { return gone_ || session_.error() != nullptr; }
  /// The rig's reason for ending the conversation.
  const Error* farewell() const { return session_.error(); }

  std::map<StreamId, std::vector<Pulled>> pulled;
  std::map<StreamId, std::uint64_t> dropped;  ///< from the newest piece, or from the end of the stream
  std::map<StreamId, std::optional<Error>> closed;
  wire::Error refusal;
  bool reading = true;  ///< false: a stuck host

 private:
  Stand& stand_;
  std::unique_ptr<hal::sim::SimLink> link_;
  Session session_;
  std::map<std::uint64_t, wire::Reply> replies_;
  std::uint64_t next_id_ = 1;
  std::optional<StreamId> uploading_;
  bool gone_ = false;
};

struct StandOptions {
  firmware::RigConfig config = small_config();
  Calibration truth = small_calibration();
  hal::sim::SimRigOptions world;
  firmware::DeviceScan* scan = nullptr;
  hal::ConfinedPort* rehearsal = nullptr;  ///< where uploaded calibrations are tried first; null: nowhere
};

class Stand {
 public:
  explicit Stand(StandOptions options = {}, std::unique_ptr<hal::sim::SimDisk> disk = nullptr,
                 std::unique_ptr<hal::sim::SimDisk> takes = nullptr);
  ~Stand();

  /// Advances time by a `tick` at a time; everything is stepped until there is nothing to do. After each
  /// tick checks that all frames are accounted for.
  void run(Duration duration);
  /// Runs until `holds` is true; returns false if it is not after `at_most`.
  bool run_until(const std::function<bool()>& holds, Duration at_most = Duration::seconds(20));
  /// Steps everything until there is nothing to do, without advancing time.
  void settle();

  TestHost& connect(hal::PeerIdentity who = {1000, 4711});
  TestHost& connect_to_view();
  TestHost& connect_to_operate();
  /// Connects a host and puts the small calibration in force.
  TestHost& bring_up();

  /// Starts the genlock, and waits until it is locked.
  void lock(TestHost& host);

  const firmware::CaptureReport& capture() { return rig->capture().report(); }
  std::uint64_t losses(int head, firmware::LossReason reason);
  std::string state() { return std::string(rig->control().health().state); }

  Duration tick = Duration::milliseconds(1);  ///< longer ones for rigs with a low frame rate
  StandOptions options;
  hal::sim::SimRig world;
  std::unique_ptr<hal::sim::SimDisk> disk;
  std::unique_ptr<hal::sim::SimDisk> takes;  ///< the disk that takes are recorded on; null in a rig that records none
  hal::sim::SimLinkListener listener;
  hal::sim::SimLinkListener view_listener;  ///< view-only
  hal::sim::SimLinkListener operate_listener;
  hal::sim::SimWatchdog watchdog;
  hal::sim::SimInputPin button;
  hal::sim::SimOutputPin status_lamp{false};
  hal::sim::SimOutputPin tally_lamp{false};
  std::unique_ptr<firmware::Rig> rig;
  std::vector<std::unique_ptr<TestHost>> hosts;

 private:
  void check_conserved();
};

}  // namespace nodal::scenario
