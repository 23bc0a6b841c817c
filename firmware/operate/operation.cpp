#include "firmware/operate/operation.h"

#include <algorithm>
#include <utility>

#include "firmware/frame/drain.h"

namespace nodal::firmware {
namespace {

Requester button() { return {Requester::Kind::kButton, 0, "button"}; }
Requester stored_settings() { return {Requester::Kind::kStoredSettings, 0, "stored settings"}; }

/// The command for the audit log, which needs no copy of a calibration's document: that may have megabytes.
Command without_document(const Command& command) {
  if (const auto* calibration = std::get_if<CalibrationCommand>(&command)) {
    if (const auto* install = std::get_if<CalibrationRequest::Install>(calibration)) {
      return CalibrationCommand(CalibrationRequest::Install{"", install->trial, "", install->allow_older});
    }
  }
  return command;
}

}  // namespace

Operation::Operation(const RigConfig& config, const Stages& stages, hal::WatchdogPort* watchdog, const PanelPins& panel,
                     Instant now)
    : config_(config),
      stages_(stages),
      capture_(&stages.capture.snapshot().read()),
      keeper_(&stages.keeper.snapshot().read()),
      takes_(stages.takes ? &stages.takes->snapshot().read() : nullptr),
      audit_(stages.audit, stages.utc),
      news_(now),
      newest_set_(now),
      unstable_(now),
      supervisor_(watchdog),
      panel_(panel) {}

void Operation::begin_step(Instant now) {
  capture_ = &stages_.capture.snapshot().read();
  keeper_ = &stages_.keeper.snapshot().read();
  if (stages_.takes) takes_ = &stages_.takes->snapshot().read();
  news_.step(now);
  watch_takes(now);
  tell_takes_the_calibration();
  watch_trial(now);
  end_leases(now);
  read_settings();
  restore_settings(now);
}

std::vector<Answer> Operation::take_answers(Instant now) {
  std::vector<Answer> answers;
  take_capture_answers(answers, now);
  take_keeper_answers(answers, now);
  take_takes_answers(answers, now);
  take_settings_answers();
  step_audit(answers, now);
  write_settings(now);
  // An answer waits for the result of the write, unless the write takes too long or is not due yet.
  if (!settings_writer_.worth_waiting(now)) {
    for (Answer& answer : std::exchange(unstored_, {})) {
      answer.not_stored = settings_writer_.problem();
      answers.push_back(std::move(answer));
    }
  }
  return answers;
}

void Operation::end_step(bool lossless, Instant now) {
  watch(lossless, now);
  watch_seams();
  watch_stability(now);
  step_panel(now);
}

Result<Ticket> Operation::ask(const Requester& requester, Command command, Instant now) {
  Open open{requester, without_document(command),
            changes_rig(command) ? values_before(command, *capture_, *keeper_) : ""};
  const Ticket ticket = next_ticket_++;
  Status asked = check(command, config_);
  if (asked) asked = hand_over(ticket, std::move(command), requester.presence);
  if (!asked) {
    // restore_settings() and end_leases() retry when the queue is full, so that is not audited as a failure.
    const bool retried =
        requester.kind == Requester::Kind::kStoredSettings || requester.kind == Requester::Kind::kLease;
    if (!retried || asked.error().code != Errc::kBusy) {
      audit(open, keeper_->in_force, asked, now);
    }
    return fail(asked.error());
  }
  open_.emplace(ticket, std::move(open));
  return ticket;
}

Status Operation::hand_over(Ticket ticket, Command command, const Presence& host) {
  if (auto* change = std::get_if<CaptureCommand>(&command)) {
    if (stages_.capture.requests().push(CaptureRequest{ticket, std::move(*change)})) return {};
    return fail(Errc::kBusy, "the rig's command queue is full; try again");
  }
  if (auto* take = std::get_if<TakeCommand>(&command)) {
    if (auto* start = std::get_if<TakeRequest::Start>(take)) {
      start->calibration = told_calibration_ = keeper_->in_force;
      if (keeper_->document) start->calibration_json = *keeper_->document;
      start->heads = head_shapes();
      start->rate = capture_->rate;
    }
    if (auto* test = std::get_if<TakeRequest::TestDisk>(take)) {
      test->heads = head_shapes();
      test->rate = capture_->rate;
    }
    if (stages_.takes && stages_.takes->requests().push({ticket, std::move(*take), host})) return {};
    return fail(Errc::kBusy, "the rig's queue of requests about takes is full; try again");
  }
  CalibrationRequest request{ticket, std::move(std::get<CalibrationCommand>(command)), head_shapes(), host};
  if (stages_.keeper.requests().push(std::move(request))) return {};
  return fail(Errc::kBusy, "the rig's queue of requests about calibrations is full; try again");
}

bool Operation::has_room(CommandStage stage) const {
  switch (stage) {
    case CommandStage::kCapture: return !stages_.capture.requests().full();
    case CommandStage::kKeeper: return !stages_.keeper.requests().full();
    case CommandStage::kTakes: return !stages_.takes || !stages_.takes->requests().full();
  }
  return false;
}

std::size_t Operation::open(std::uint64_t host, CommandStage stage) const {
  return static_cast<std::size_t>(std::count_if(open_.begin(), open_.end(), [&](const auto& entry) {
    const Open& open = entry.second;
    return open.requester.kind == Requester::Kind::kHost && open.requester.host == host &&
           stage_of(open.command) == stage;
  }));
}

Operation::Open Operation::close(Ticket ticket) {
  const auto found = open_.find(ticket);
  NODAL_ASSERT(found != open_.end());
  Open open = std::move(found->second);
  open_.erase(found);
  return open;
}

void Operation::take_capture_answers(std::vector<Answer>& answers, Instant now) {
  drain(stages_.capture.answers(), [&](CaptureAnswer answer) {
    Open open = close(answer.ticket);
    audit(open, std::nullopt, answer.status, now);
    if (!answer.status) {
      const std::string& why = answer.status.error().message;
      if (open.requester.kind == Requester::Kind::kButton) news_.say(NewsKind::kRig, "the button did nothing: " + why);
      if (open.requester.kind == Requester::Kind::kStoredSettings) {
        news_.say(NewsKind::kRig, "could not restore a stored setting: " + why);
      }
      answers.push_back({answer.ticket, fail(answer.status.error())});
      return;
    }
    CaptureCommand& change = std::get<CaptureCommand>(open.command);
    Outcome outcome = CommandDone{answer.at};
    if (auto* exposure = std::get_if<ExposureChange>(&change)) {
      // The program is stored even when the command does not name it, because Settings::commands() first switches to
      // "manual" and has to switch back, also to a program that came from rig.toml.
      exposure->program = answer.exposure.settings.program;
      outcome = answer.exposure;
    } else if (!std::holds_alternative<HeadChange>(change) && !std::holds_alternative<LeaseEnd>(change)) {
      outcome = answer.genlock;
    }
    if (open.requester.kind != Requester::Kind::kStoredSettings) {
      settings_.remember(change);
      settings_writer_.changed();
    }
    if (open.requester.kind == Requester::Kind::kHost) unstored_.push_back({answer.ticket, std::move(outcome)});
  });
}

void Operation::take_keeper_answers(std::vector<Answer>& answers, Instant now) {
  drain(stages_.keeper.answers(), [&](CalibrationAnswer answer) {
    const Open open = close(answer.ticket);
    const auto* done = answer.result ? std::get_if<CalibrationAnswer::Done>(&*answer.result) : nullptr;
    const auto receipt = audit(open, done ? done->in_force : keeper_->in_force,
                               answer.result ? Status() : fail(answer.result.error()), now);
    if (!answer.result) {
      answers.push_back({answer.ticket, fail(answer.result.error())});
      return;
    }
    Outcome outcome = CommandDone{};
    if (auto* listed = std::get_if<CalibrationAnswer::Listed>(&*answer.result)) outcome = std::move(*listed);
    else if (auto* document = std::get_if<CalibrationAnswer::Document>(&*answer.result)) outcome = std::move(*document);
    answer_when_recorded({answer.ticket, std::move(outcome)}, receipt);
  });
}

void Operation::take_takes_answers(std::vector<Answer>& answers, Instant now) {
  if (!stages_.takes) return;
  drain(stages_.takes->answers(), [&](TakeAnswer answer) {
    const Open open = close(answer.ticket);
    const auto receipt = audit(open, std::nullopt, answer.result ? Status() : fail(answer.result.error()), now);
    if (!answer.result) {
      answers.push_back({answer.ticket, fail(answer.result.error())});
      return;
    }
    answer_when_recorded(
        {answer.ticket, std::visit([](auto& what) { return Outcome(std::move(what)); }, *answer.result)}, receipt);
  });
}

/// Logs what happens to takes and to their disk.
void Operation::watch_takes(Instant now) {
  if (!takes_) return;
  if (takes_->problem != take_problem_) {
    take_problem_ = takes_->problem;
    if (!take_problem_.empty()) news_.say(NewsKind::kRig, take_problem_);
  }
  if (takes_->no_disk != no_disk_) {
    no_disk_ = takes_->no_disk;
    news_.say(NewsKind::kRig,
              no_disk_.empty() ? "the disk of the takes is there" : "the disk of the takes: " + no_disk_);
  }
  if (config_.takes->at_start) start_take_at_boot(now);
}

/// Starts the take of [takes] start = "boot" when the rig has a calibration and frames, and another one after a take
/// that ended for a reason that has passed: a new disk, room. A take that somebody stopped stays stopped.
void Operation::start_take_at_boot(Instant now) {
  TakeAtStart& state = take_at_start_;
  if (takes_->recording) {
    state = {true, takes_->disks, now, kFirstTakeWait};
    return;
  }
  if (std::exchange(state.disks, takes_->disks) != takes_->disks)
    state = {state.begun, takes_->disks, now, kFirstTakeWait};
  const bool wanted = (!state.begun || takes_->interrupted) && takes_->has_room;
  if (!wanted || now < state.next || !takes_->ready || !keeper_->ready || capture_->full_sets == 0) return;
  state.next = now + state.wait;
  state.wait = std::min(state.wait * 2, kLastTakeWait);
  if (const auto asked = ask({Requester::Kind::kConfiguration, 0, "rig.toml"}, TakeCommand(TakeRequest::Start{}), now);
      !asked) {
    news_.say(NewsKind::kRig, "the take of [takes] start = \"boot\": " + asked.error().message);
  }
}

/// A take has every calibration that its raymaps were made with.
void Operation::tell_takes_the_calibration() {
  if (!takes_) return;
  if (keeper_->in_force && keeper_->document && (documents_.empty() || documents_.back().first != *keeper_->in_force)) {
    documents_.emplace_back(*keeper_->in_force, keeper_->document);
    if (documents_.size() > kDocumentsKept) documents_.pop_front();
  }
  if (!takes_->recording) return;
  const Adoption& adopted = stages_.blender.swap().adoption().read();
  if (adopted.calibration == told_calibration_) return;
  const auto known = std::ranges::find(documents_, adopted.calibration, &std::pair<Sha256, Document>::first);
  if (known == documents_.end()) return;
  if (stages_.takes->calibrations().push({adopted.first_set, adopted.calibration, *known->second}))
    told_calibration_ = adopted.calibration;
}

void Operation::take_settings_answers() {
  drain(stages_.settings.answers(), [&](const Status& stored) {
    if (!settings_writer_.ended(stored)) return;
    news_.say(NewsKind::kRig, stored ? "settings are stored again" : settings_writer_.problem());
  });
}

/// Reports the start and the end of a trial, and audits its end by time.
void Operation::watch_trial(Instant now) {
  if (keeper_->trial.has_value() == on_trial_.has_value()) return;
  if (keeper_->trial) {
    on_trial_ = *keeper_->trial;
    news_.say(NewsKind::kRig, "calibration '" + keeper_->name + "' is on trial");
    return;
  }
  const bool kept = keeper_->in_force == on_trial_->id;
  news_.say(NewsKind::kRig, kept ? "the calibration on trial stays in force"
                                 : "the trial has ended; calibration '" + keeper_->name + "' is in force again");
  if (!kept && now >= on_trial_->until) {
    AuditEntry entry;
    entry.who = "timeout of the trial";
    entry.what = command_name(Command(CalibrationRequest::EndTrial{}));
    entry.before = calibration_text(on_trial_->id) + " on trial";
    entry.after = calibration_text(keeper_->in_force);
    audit_.record(std::move(entry), "the rig", true, now);
  }
  on_trial_.reset();
}

void Operation::end_lease(std::uint64_t host, const std::string& name) {
  leases_to_end_[host] = "end of the temporary settings of " + name;
}

/// Commands of these hosts that are on their way to the stage come before. Asks again in the next step when the queue
/// is full.
void Operation::end_leases(Instant now) {
  std::erase_if(leases_to_end_, [&](const auto& lease) {
    const auto& [host, who] = lease;
    return ask({Requester::Kind::kLease, 0, who}, CaptureCommand(LeaseEnd{host}), now).has_value();
  });
}

/// Takes the stored settings when the store has read them.
void Operation::read_settings() {
  if (restoring_) return;
  const SettingsReport& stored = stages_.settings.snapshot().read();
  if (!stored.file) return;
  restoring_.emplace();
  if (!stored.problem.empty()) {
    news_.say(NewsKind::kRig, stored.problem);
    settings_writer_.unreadable(stored.problem);
  }
  if (stored.file->empty()) return;
  auto settings = Settings::decode(
      std::span(reinterpret_cast<const std::uint8_t*>(stored.file->data()), stored.file->size()), config_.text_id);
  if (!settings) {
    news_.say(NewsKind::kRig, settings.error().message);
    // A changed rig.toml is intended and no problem; an unreadable file is one.
    if (settings.error().code != Errc::kWrongState) settings_writer_.unreadable(settings.error().message);
    return;
  }
  settings_ = std::move(*settings);
  for (CaptureCommand& change : settings_.commands()) restoring_->push_back(std::move(change));
  news_.say(NewsKind::kRig, "restoring the stored settings");
}

/// Sends the stored settings to capture, as many as its queue takes in each step.
void Operation::restore_settings(Instant now) {
  while (restoring_ && !restoring_->empty()) {
    const auto asked = ask(stored_settings(), Command(restoring_->front()), now);
    if (!asked && asked.error().code == Errc::kBusy) return;
    if (!asked) news_.say(NewsKind::kRig, "could not restore a stored setting: " + asked.error().message);
    restoring_->pop_front();
  }
}

void Operation::write_settings(Instant now) {
  if (!settings_writer_.due(now)) return;
  if (stages_.settings.writes().push(settings_.encode(config_.text_id))) {
    settings_writer_.begun(now);
  }
}

void Operation::step_panel(Instant now) {
  const bool on = takes_ ? takes_->recording.has_value() : capture_->genlock.state != GenlockState::kOff;
  const bool rolling = on && !supervisor_.actions().end;
  const auto action = panel_.step({health().state, rolling, capture_->sets, period()}, now);
  if (action) act(*action, now);
  while (auto problem = panel_.take_problem()) news_.say(NewsKind::kRig, std::move(*problem));
}

void Operation::act(PanelAction action, Instant now) {
  if (action == PanelAction::kMark) {
    marks_.push_back({capture_->sets == 0 ? 0 : capture_->sets - 1, now});
    if (marks_.size() > kMarksKept) marks_.pop_front();
    news_.say(NewsKind::kRig, "marked set " + std::to_string(marks_.back().set));
    if (takes_) ask_by_button(TakeCommand(TakeRequest::Mark{"button"}), now);
    return;
  }
  const bool start = action == PanelAction::kStart;
  const std::string what = takes_ ? "a take" : "the genlock";
  news_.say(NewsKind::kRig, "the button " + std::string(start ? "starts " : "stops ") + what);
  if (!takes_) {
    ask_by_button(start ? CaptureCommand(GenlockStart{}) : CaptureCommand(GenlockStop{}), now);
    return;
  }
  const bool runs_free = config_.trigger.source == SyncSource::kNone;
  if (start && !runs_free && capture_->genlock.state == GenlockState::kOff)
    ask_by_button(CaptureCommand(GenlockStart{}), now);
  ask_by_button(start ? TakeCommand(TakeRequest::Start{}) : TakeCommand(TakeRequest::Stop{}), now);
}

void Operation::ask_by_button(Command command, Instant now) {
  if (const auto asked = ask(button(), std::move(command), now); !asked) {
    news_.say(NewsKind::kRig, "the button did nothing: " + asked.error().message);
  }
}

HeadShapes Operation::head_shapes() const {
  HeadShapes shapes;
  for (const HeadReport& head : capture_->heads) {
    shapes.emplace_back();
    if (head.format) shapes.back() = HeadShape{head.format->pixels, head.format->width, head.format->height};
  }
  return shapes;
}

}  // namespace nodal::firmware
