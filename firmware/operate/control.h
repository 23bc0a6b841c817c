// The stage that talks to hosts.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "firmware/calibration/calibration_keeper.h"
#include "firmware/capture/capture.h"
#include "firmware/config/config.h"
#include "firmware/frame/statistics.h"
#include "firmware/hosts/access.h"
#include "firmware/hosts/admission.h"
#include "firmware/hosts/client.h"
#include "firmware/hosts/frame_sender.h"
#include "firmware/hosts/publisher.h"
#include "firmware/operate/audit.h"
#include "firmware/operate/health.h"
#include "firmware/operate/news.h"
#include "firmware/operate/panel.h"
#include "firmware/operate/shedding.h"
#include "firmware/picture/blender.h"
#include "firmware/picture/encoder.h"
#include "firmware/storage/settings.h"
#include "firmware/storage/settings_writer.h"
#include "hal/link.h"
#include "hal/watchdog.h"
#include "protocol/upload.h"

namespace nodal::firmware {

/// The stages that control asks and tells of.
struct Stages {
  Capture& capture;
  Blender& blender;
  EncodeStage& encoder;
  CalibrationKeeper& keeper;
  Outlet<SetLoan>& frame_sets;  ///< for hosts that ask for the heads' own pictures
};

/// Accepts hosts, answers their requests, takes their uploads, gives them raymaps. A request that another stage must
/// carry out is passed on with a ticket, and answered when that stage answers; meanwhile everybody else is served.
///
/// Threading: step() is thread-bound to control; set_resident_bytes(), ask_to_end() and ended() are for any thread.
/// Ownership: owns the clients; listeners and stages outlive it.
/// Errors: a host's errors are answers to it; news() has what an operator should read.
class Control {
 public:
  Control(const RigConfig& config, std::string software, const Stages& stages, std::vector<Listener> listeners,
          hal::WatchdogPort* watchdog, const PanelPins& panel, Instant now);
  ~Control();

  /// True when it did something.
  bool step(Instant now);

  /// Sentences for the log since the last call: hosts that came and went, states that changed.
  std::vector<std::string> take_news();
  const Health& health() const { return supervisor_.health(); }
  /// The rig stops, for this reason: hosts are told, none is let in. Any thread, once.
  void ask_to_end(std::string reason);
  /// Every host has been told, or would not listen for kFarewell. Any thread.
  bool ended() const { return ended_.load(std::memory_order_acquire); }
  std::size_t clients() const { return clients_.size(); }
  void set_resident_bytes(std::uint64_t bytes) { resident_bytes_.store(bytes, std::memory_order_relaxed); }
  wire::RigStatus status(Instant now);
  /// Frame sets that the blend had no room for, as of the newest step.
  std::uint64_t sets_missed_by_blend() const;

  static constexpr Duration kFarewell = Duration::milliseconds(500);
  /// Without a hanging stage, after which a start counts as good: twice what a stage may hang unnoticed.
  static constexpr Duration kRunsWellAfter = Supervisor::kStuckAfter * 2;
  static constexpr std::size_t kMaxRequests = 16;  ///< of a client, not yet answered
  /// Of them, those that another stage may have: so few that there is room in its ring for every client's.
  static constexpr std::size_t kCaptureRequests = 4;
  static constexpr std::size_t kKeeperRequests = 1;
  /// Of a client in a step. A status takes some 10 us to make, so a client that floods the rig with requests costs the
  /// others less than 0.1 ms a step; what is left waits in its session, and then in its link.
  static constexpr int kRequestsAStep = 8;
  static constexpr int kEventsAStep = 64;              ///< of all kinds: 4 MiB of pieces
  static constexpr std::size_t kUploadsOfAClient = 2;  ///< half there at once

 private:
  /// A moment that somebody at the rig wants found again.
  struct Mark {
    std::uint64_t set = 0;  ///< the newest one then
    Instant at;
  };
  /// A request that another stage has.
  struct Open {
    std::uint64_t client = kNobody;
    wire::Request request;
    std::string who;     ///< as the audit log has it
    std::string before;  ///< the values that it changes; empty: it changes none
  };
  /// The reply to a setting that is in effect and being written.
  struct Unanswered {
    std::uint64_t client = kNobody;
    wire::Reply reply;
  };
  static constexpr std::size_t kMarksKept = 32;
  // Tickets of Control's own, which no host waits for.
  static constexpr std::uint64_t kRememberTicket = 0;
  static constexpr std::uint64_t kRunsWellTicket = ~std::uint64_t{0};
  static constexpr std::uint64_t kNobody = 0;  ///< a setting that is made again after a start
  static constexpr std::uint64_t kPanel = ~std::uint64_t{0};

  void drop_finished();
  bool serve_all(Instant now);
  bool serve(Client& client, Instant now);
  static bool has_room(const Client& client, const wire::Request& request);
  void handle(Client& client, Event& event, Instant now);
  void handle(Client& client, const wire::Request& request, Instant now);
  Result<StreamId> start_work(Client& client, const wire::Request& request, Instant now);
  Status end_host(const Client& client, std::uint64_t number, Instant now);
  Status set(std::uint64_t client, const wire::Request& request);
  Result<CaptureCommand> head_command(const wire::HeadSetRequest& wish) const;
  Result<CaptureCommand> exposure_command(const wire::ExposureRequest& wish) const;
  Result<CaptureCommand> genlock_command(const wire::GenlockRequest& wish) const;
  Open open_request(std::uint64_t client, const wire::Request& request);
  void audit(const Open& open, const std::optional<Sha256>& in_force, const Status& done, Instant now);
  Status ask_keeper(Client& client, const wire::Request& request, decltype(KeeperRequest::what) what);
  Status commit(Client& client, const wire::Request& request);
  Status pull(Client& client, const wire::Request& request);
  void reply(Client& client, const wire::Reply& reply, Instant now);
  void refuse(Client& client, std::uint64_t request, const Error& error, Instant now);
  bool take_answers(Instant now);
  void take_answer(const CaptureAnswer& answer, Instant now);
  void take_answer(KeeperAnswer answer, Instant now);
  std::pair<Client*, Open> close(std::uint64_t ticket);
  void act(PanelAction action, Instant now);
  void step_panel(Instant now);
  void watch_trial(Instant now);
  void restore_settings();
  void remember_settings(Instant now);
  void answer_settings(Instant now);
  Client* find(std::uint64_t number);
  HeadShapes head_shapes() const;
  void watch(Instant now);
  void tell_that_it_runs_well(Instant now);
  std::uint32_t rate_wanted_millihertz() const;  ///< of raymaps
  void shed(Instant now);
  void end(Instant now);
  wire::Hello hello(Access access) const;

  const RigConfig config_;
  const std::string software_;
  Stages stages_;
  Admission admission_;
  const Instant started_;

  Clients clients_;
  std::size_t first_served_ = 0;  ///< the client whose turn is first; the next one's in the next step
  std::uint64_t next_ticket_ = 1;
  std::map<std::uint64_t, Open> open_;
  std::optional<Trial> on_trial_;
  UploadReceiver uploads_;
  Settings settings_;
  std::optional<std::deque<wire::Request>> restoring_;  ///< once they were read
  SettingsWriter settings_writer_;
  std::vector<Unanswered> unanswered_;  ///< each counts as one of its client's requests_open
  Publisher publisher_;
  FrameSender frame_sender_;

  const CaptureReport* capture_;  ///< newest
  const KeeperReport* keeper_;
  std::uint64_t sets_seen_ = 0;
  Instant newest_set_;
  std::uint64_t adopted_ = 0;
  Instant steady_since_;
  RecentRate rate_;
  std::optional<Instant> judged_;
  Instant unwell_;          ///< when the rig was last starting or hanging
  bool told_well_ = false;  ///< to the keeper
  Supervisor supervisor_;
  Shedding shedding_;
  std::string end_reason_;  ///< once end_asked_
  std::atomic<bool> end_asked_{false};
  std::optional<Instant> ending_since_;
  std::atomic<bool> ended_{false};
  Panel panel_;
  std::deque<Mark> marks_;
  AuditLog audit_;
  News news_;
  std::atomic<std::uint64_t> resident_bytes_{0};
};

}  // namespace nodal::firmware
