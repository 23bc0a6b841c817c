// Runs the rig: passes commands to its stages, returns their answers, stores settings, and assesses the rig's state.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "firmware/config/config.h"
#include "firmware/operate/change_audit.h"
#include "firmware/operate/commands.h"
#include "firmware/operate/news.h"
#include "firmware/operate/panel.h"
#include "firmware/operate/rig_watch.h"
#include "firmware/operate/settings_keeper.h"
#include "firmware/operate/stages.h"
#include "firmware/operate/take_watch.h"
#include "hal/watchdog.h"

namespace nodal::firmware {

/// Passes commands with a ticket to the stages that carry them out, and returns the answers when they arrive. Every
/// change is audited, whatever its origin; every setting that a stage applied is stored. It also serves the
/// button and the lamps; RigWatch assesses the rig's state.
///
/// Threading: thread-bound to control, except ask_to_end().
/// Ownership: the stages outlive it.
/// Errors: ask()'s, and those in the answers; news() returns messages for the operator.
class Operation {
 public:
  Operation(const RigConfig& config, const Stages& stages, hal::WatchdogPort* watchdog, const PanelPins& panel,
            Instant now);

  static constexpr Duration kStepEvery = Duration::milliseconds(20);

  /// First call of a step, before commands: reads the stages' newest reports and restores stored settings.
  void begin_step(Instant now);
  /// Call after the commands of a step. Returns the answers that arrived since the last call.
  std::vector<Answer> take_answers(Instant now);
  /// The longest time between two steps.
  Duration step_every() const { return panel_.present() ? Panel::kStepEvery : kStepEvery; }
  /// Last call of a step. `lossless`: a client pulls without loss, so no raymap may be shed.
  void end_step(bool lossless, Instant now);

  /// Passes a command to its stage. Errors: check()'s, and kBusy when the stage's queue is full. A failed change is
  /// audited.
  Result<Ticket> ask(const Requester& requester, Command command, Instant now);
  /// Audits the end of a host's connection. The answer comes when the entry is on the disk.
  Ticket note_host_end(const Requester& requester, const std::string& host, Instant now);
  /// The log of changes, for requests that are answered without a stage.
  ChangeAudit& audit() { return audit_; }
  const ChangeAudit& audit() const { return audit_; }
  /// Number of unanswered commands of a host at a stage.
  std::size_t open(std::uint64_t host, CommandStage stage) const;
  /// Whether the stage's queue takes another command now; otherwise it must wait.
  bool has_room(CommandStage stage) const;
  /// Number of all commands whose answers take_answers() has not returned yet.
  std::size_t unanswered() const { return open_.size() + unstored_.size() + audit_.waiting(); }

  /// The host's session ended or fell silent: its temporary settings are undone. `name`: for the audit log.
  void end_lease(std::uint64_t host, const std::string& name);

  /// Starts the end of the rig, for this reason. Any thread; call it once.
  void ask_to_end(std::string reason);
  bool asked_to_end() const { return end_asked_.load(std::memory_order_acquire); }
  /// The reason, after the supervisor has started the end; null before.
  const std::string* end_reason() const { return watch_.ends() ? &end_reason_ : nullptr; }

  /// The stages' reports as of this step.
  const CaptureReport& capture() const { return *reports_.capture; }
  const KeeperReport& keeper() const { return *reports_.keeper; }
  /// Null: the rig records nothing.
  const TakeReport* takes() const { return reports_.takes; }
  const RigWatch& watch() const { return watch_; }
  const Health& health() const { return watch_.health(); }
  News& news() { return news_; }
  /// Period of the frame rate in force.
  Duration period() const { return capture().genlock.rate.period(); }
  /// The known formats of the heads.
  HeadShapes head_shapes() const;

  /// A moment that a person marked with the button.
  struct Mark {
    std::uint64_t set = 0;  ///< number of the newest set at that moment
    Instant at;
  };
  const std::deque<Mark>& marks() const { return marks_; }

  static constexpr std::size_t kMarksKept = 32;

 private:
  /// An unanswered command.
  struct Open {
    Requester requester;
    Command command;
    std::string before;  ///< values_before() of a change; empty for a query
  };

  void read_reports();
  Status hand_over(Ticket ticket, Command command, const Presence& host);
  Open close(Ticket ticket);
  void take_capture_answers(std::vector<Answer>& answers, Instant now);
  void take_keeper_answers(std::vector<Answer>& answers, Instant now);
  void take_takes_answers(std::vector<Answer>& answers, Instant now);
  AuditLog::Receipt audit(const Open& open, const std::optional<Sha256>& in_force, const Status& done, Instant now);
  void watch_trial(Instant now);
  void watch_takes(Instant now);
  void end_leases(Instant now);
  void restore_settings(Instant now);
  void step_panel(Instant now);
  void act(PanelAction action, Instant now);
  void ask_by_button(Command command, Instant now);

  const RigConfig config_;
  Stages stages_;
  Reports reports_;

  Ticket next_ticket_ = 1;
  std::map<Ticket, Open> open_;
  std::map<std::uint64_t, std::string> leases_to_end_;  ///< by host; who ends it, for the audit log
  std::vector<Answer> unstored_;  ///< answers about settings that wait for the result of the write
  std::optional<Trial> on_trial_;
  News news_;
  ChangeAudit audit_;

  SettingsKeeper settings_;
  TakeWatch take_watch_;
  RigWatch watch_;
  std::string end_reason_;  ///< valid when end_asked_ is true
  std::atomic<bool> end_asked_{false};
  Panel panel_;
  std::deque<Mark> marks_;
};

}  // namespace nodal::firmware
