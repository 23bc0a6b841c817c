// What the rig does: commands to its stages and their answers, what is remembered of them, and how the rig is.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "firmware/calibration/calibration_keeper.h"
#include "firmware/capture/capture.h"
#include "firmware/config/config.h"
#include "firmware/frame/statistics.h"
#include "firmware/operate/audit.h"
#include "firmware/operate/commands.h"
#include "firmware/operate/health.h"
#include "firmware/operate/news.h"
#include "firmware/operate/panel.h"
#include "firmware/operate/settings.h"
#include "firmware/operate/settings_writer.h"
#include "firmware/operate/shedding.h"
#include "firmware/picture/blender.h"
#include "firmware/picture/encoder.h"
#include "firmware/storage/settings_store.h"
#include "hal/watchdog.h"

namespace nodal::firmware {

/// The stages that are operated.
struct Stages {
  Capture& capture;
  Blender& blender;
  EncodeStage& encoder;
  CalibrationKeeper& keeper;
  SettingsStore& settings;
};

/// Hands commands to the stages that carry them out, each with a ticket, and gives the answers when they come. Every
/// change is audited, whoever asked for it; every setting that a stage made is remembered and stored. It also judges how
/// the rig is, sheds work, serves the button and the lamps, and feeds the watchdog.
///
/// Threading: thread-bound to control, but for ask_to_end().
/// Ownership: the stages outlive it.
/// Errors: ask()'s, and in the answers; news() has what an operator should read.
class Operation {
 public:
  Operation(const RigConfig& config, const Stages& stages, hal::WatchdogPort* watchdog, const PanelPins& panel,
            Instant now);

  /// Before commands in a step: the stages' newest reports; settings of the last start are made again.
  void begin_step(Instant now);
  /// After commands in a step. What was answered since the last call.
  std::vector<Answer> take_answers(Instant now);
  /// Last in a step. `lossless`: raymaps are sent to somebody who must be given every one, so that none may be shed.
  void end_step(bool lossless, Instant now);

  /// Errors: check()'s, and kBusy when the stage has more than it can take. A change that fails is audited.
  Result<Ticket> ask(const Asker& asker, Command command, Instant now);
  /// Audits a change that a face could not make a command of.
  void note_refused(const Asker& asker, std::string_view what, const Error& why, Instant now);
  /// Commands of a host that a stage has.
  std::size_t open(std::uint64_t host, CommandStage stage) const;
  /// Commands of anybody's whose answers are still to be taken.
  std::size_t unanswered() const { return open_.size() + unstored_.size(); }

  /// The rig stops, for this reason. Any thread, once.
  void ask_to_end(std::string reason);
  bool asked_to_end() const { return end_asked_.load(std::memory_order_acquire); }
  /// Why, once the supervisor has the rig end; else nothing.
  const std::string* end_reason() const { return supervisor_.acts().end ? &end_reason_ : nullptr; }

  /// The stages' reports as of this step.
  const CaptureReport& capture() const { return *capture_; }
  const KeeperReport& keeper() const { return *keeper_; }
  const Health& health() const { return supervisor_.health(); }
  const AuditLog& audit_log() const { return audit_; }
  News& news() { return news_; }
  std::uint32_t rate_millihertz() const { return rate_.millihertz(); }  ///< of raymaps
  std::uint32_t rate_wanted_millihertz() const;
  /// Frame sets that the blend had no room for.
  std::uint64_t sets_missed_by_blend() const;
  /// What the heads deliver, as far as that is known.
  HeadShapes head_shapes() const;

  /// A moment that somebody at the rig wants found again.
  struct Mark {
    std::uint64_t set = 0;  ///< the newest one then
    Instant at;
  };
  const std::deque<Mark>& marks() const { return marks_; }

  static constexpr std::size_t kMarksKept = 32;
  /// Without a hanging stage, after which a start counts as good: twice what a stage may hang unnoticed.
  static constexpr Duration kRunsWellAfter = Supervisor::kStuckAfter * 2;

 private:
  /// A command that a stage has.
  struct Open {
    Asker asker;
    Command command;
    std::string before;  ///< the values that it changes; empty: it changes none
  };

  Status hand_over(Ticket ticket, Command command);
  Open close(Ticket ticket);
  void take_capture_answers(std::vector<Answer>& answers, Instant now);
  void take_keeper_answers(std::vector<Answer>& answers, Instant now);
  void take_settings_answers();
  void audit(const Open& open, const std::optional<Sha256>& in_force, const Status& done, Instant now);
  void watch_trial(Instant now);
  void read_settings();
  void restore_settings(Instant now);
  void write_settings(Instant now);
  void watch(bool lossless, Instant now);
  void shed(bool lossless, Instant now);
  void tell_that_it_runs_well(Instant now);
  void step_panel(Instant now);
  void act(PanelAction action, Instant now);

  const RigConfig config_;
  Stages stages_;
  const CaptureReport* capture_;  ///< newest
  const KeeperReport* keeper_;

  Ticket next_ticket_ = 1;
  std::map<Ticket, Open> open_;
  std::vector<Answer> unstored_;  ///< settings in effect, to be answered when it is known whether they are stored
  std::optional<Trial> on_trial_;
  AuditLog audit_;
  News news_;

  Settings settings_;
  std::optional<std::deque<CaptureChange>> restoring_;  ///< once they were read
  SettingsWriter settings_writer_;

  std::uint64_t sets_seen_ = 0;
  Instant newest_set_;
  std::uint64_t adopted_ = 0;
  Instant steady_since_;
  RecentRate rate_;
  std::optional<Instant> judged_;
  Instant unwell_;          ///< when the rig was last starting or hanging
  bool told_well_ = false;  ///< to the settings' store
  Supervisor supervisor_;
  Shedding shedding_;
  std::string end_reason_;  ///< once end_asked_
  std::atomic<bool> end_asked_{false};
  Panel panel_;
  std::deque<Mark> marks_;
};

}  // namespace nodal::firmware
