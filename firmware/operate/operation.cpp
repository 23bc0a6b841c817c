#include "firmware/operate/operation.h"

#include <fmt/format.h>

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
      news_(now),
      audit_(stages.audit, stages.utc, news_),
      settings_(stages.settings, config.text_id),
      take_watch_(stages.blender.swap().adoption(), stages.takes ? &stages.takes->calibrations() : nullptr,
                  config.takes && config.takes->at_start),
      watch_(config_, stages, news_, watchdog, now),
      panel_(panel) {
  read_reports();
}

void Operation::read_reports() {
  reports_ = {&stages_.capture.snapshot().read(), &stages_.keeper.snapshot().read(),
              stages_.takes ? &stages_.takes->snapshot().read() : nullptr};
}

void Operation::begin_step(Instant now) {
  read_reports();
  news_.step(now);
  watch_takes(now);
  watch_trial(now);
  end_leases(now);
  settings_.read(news_);
  restore_settings(now);
}

std::vector<Answer> Operation::take_answers(Instant now) {
  std::vector<Answer> answers;
  take_capture_answers(answers, now);
  take_keeper_answers(answers, now);
  take_takes_answers(answers, now);
  settings_.take_answers(news_);
  audit_.step(asked_to_end(), answers, now);
  settings_.write(now);
  // An answer waits for the result of the write, unless the write takes too long or is not due yet.
  if (!settings_.worth_waiting(now)) {
    for (Answer& answer : std::exchange(unstored_, {})) {
      answer.not_stored = settings_.problem();
      answers.push_back(std::move(answer));
    }
  }
  return answers;
}

void Operation::end_step(bool lossless, Instant now) {
  const std::string& store_problem = settings_.problem().empty() ? audit_.problem() : settings_.problem();
  watch_.step({reports_, store_problem, lossless, asked_to_end() ? &end_reason_ : nullptr}, now);
  step_panel(now);
}

Result<Ticket> Operation::ask(const Requester& requester, Command command, Instant now) {
  Open open{requester, without_document(command),
            kind_of(command).changes ? values_before(command, capture(), keeper()) : ""};
  const Ticket ticket = next_ticket_++;
  Status asked = check(command, config_);
  if (asked) asked = hand_over(ticket, std::move(command), requester.presence);
  if (!asked) {
    // restore_settings() and end_leases() retry when the queue is full, so that is not audited as a failure.
    const bool retried =
        requester.kind == Requester::Kind::kStoredSettings || requester.kind == Requester::Kind::kLease;
    if (!retried || asked.error().code != Errc::kBusy) {
      audit(open, keeper().in_force, asked, now);
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
      start->calibration = keeper().in_force;
      take_watch_.note_start(start->calibration);
      if (keeper().document) start->calibration_json = *keeper().document;
      start->heads = head_shapes();
      start->rate = capture().rate;
    }
    if (auto* test = std::get_if<TakeRequest::TestDisk>(take)) {
      test->heads = head_shapes();
      test->rate = capture().rate;
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
           kind_of(open.command).stage == stage;
  }));
}

Operation::Open Operation::close(Ticket ticket) {
  const auto found = open_.find(ticket);
  NODAL_ASSERT(found != open_.end());
  Open open = std::move(found->second);
  open_.erase(found);
  return open;
}

AuditLog::Receipt Operation::audit(const Open& open, const std::optional<Sha256>& in_force, const Status& done,
                                   Instant now) {
  if (!kind_of(open.command).changes) return 0;
  return audit_.note_change(open.requester, open.command, open.before, values_after(open.command, config_, in_force),
                            done, now);
}

Ticket Operation::note_host_end(const Requester& requester, const std::string& host, Instant now) {
  const Ticket ticket = next_ticket_++;
  audit_.answer_when_recorded({ticket, Outcome(CommandDone{})}, audit_.note_host_end(requester, host, now));
  return ticket;
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
    }
    if (open.requester.kind == Requester::Kind::kHost) unstored_.push_back({answer.ticket, std::move(outcome)});
  });
}

void Operation::take_keeper_answers(std::vector<Answer>& answers, Instant now) {
  drain(stages_.keeper.answers(), [&](CalibrationAnswer answer) {
    const Open open = close(answer.ticket);
    const auto* done = answer.result ? std::get_if<CalibrationAnswer::Done>(&*answer.result) : nullptr;
    const auto receipt = audit(open, done ? done->in_force : keeper().in_force,
                               answer.result ? Status() : fail(answer.result.error()), now);
    if (!answer.result) {
      answers.push_back({answer.ticket, fail(answer.result.error())});
      return;
    }
    Outcome outcome = CommandDone{};
    if (auto* listed = std::get_if<CalibrationAnswer::Listed>(&*answer.result)) outcome = std::move(*listed);
    else if (auto* document = std::get_if<CalibrationAnswer::Document>(&*answer.result)) outcome = std::move(*document);
    audit_.answer_when_recorded({answer.ticket, std::move(outcome)}, receipt);
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
    audit_.answer_when_recorded(
        {answer.ticket, std::visit([](auto& what) { return Outcome(std::move(what)); }, *answer.result)}, receipt);
  });
}

void Operation::watch_takes(Instant now) {
  if (!take_watch_.step(reports_, news_, now)) return;
  if (const auto asked = ask({Requester::Kind::kConfiguration, 0, "rig.toml"}, TakeCommand(TakeRequest::Start{}), now);
      !asked) {
    news_.say(NewsKind::kRig, "the take of [takes] start = \"boot\": " + asked.error().message);
  }
}

/// Reports the start and the end of a trial, and audits its end by time.
void Operation::watch_trial(Instant now) {
  if (keeper().trial.has_value() == on_trial_.has_value()) return;
  if (keeper().trial) {
    on_trial_ = *keeper().trial;
    news_.say(NewsKind::kRig, "calibration '" + keeper().name + "' is on trial");
    return;
  }
  const bool kept = keeper().in_force == on_trial_->id;
  news_.say(NewsKind::kRig, kept ? "the calibration on trial stays in force"
                                 : "the trial has ended; calibration '" + keeper().name + "' is in force again");
  if (!kept && now >= on_trial_->until) {
    audit_.note_own_change("timeout of the trial", kCommandKind<CalibrationRequest::EndTrial>.name,
                           calibration_text(on_trial_->id) + " on trial", calibration_text(keeper().in_force), now);
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

/// Sends the stored settings to capture, as many as its queue takes in each step.
void Operation::restore_settings(Instant now) {
  while (const CaptureCommand* stored = settings_.next_to_restore()) {
    const auto asked = ask(stored_settings(), Command(*stored), now);
    if (!asked && asked.error().code == Errc::kBusy) return;
    if (!asked) news_.say(NewsKind::kRig, "could not restore a stored setting: " + asked.error().message);
    settings_.restored();
  }
}

void Operation::step_panel(Instant now) {
  const bool on = takes() ? takes()->recording.has_value() : capture().genlock.state != GenlockState::kOff;
  const bool rolling = on && !watch_.ends();
  const auto action = panel_.step({health().state, rolling, capture().sets, period()}, now);
  if (action) act(*action, now);
  while (auto problem = panel_.take_problem()) news_.say(NewsKind::kRig, std::move(*problem));
}

void Operation::act(PanelAction action, Instant now) {
  if (action == PanelAction::kMark) {
    marks_.push_back({capture().sets == 0 ? 0 : capture().sets - 1, now});
    if (marks_.size() > kMarksKept) marks_.pop_front();
    news_.say(NewsKind::kRig, fmt::format("marked set {}", marks_.back().set));
    if (takes()) ask_by_button(TakeCommand(TakeRequest::Mark{"button"}), now);
    return;
  }
  const bool start = action == PanelAction::kStart;
  const std::string what = takes() ? "a take" : "the genlock";
  news_.say(NewsKind::kRig, "the button " + std::string(start ? "starts " : "stops ") + what);
  if (!takes()) {
    ask_by_button(start ? CaptureCommand(GenlockStart{}) : CaptureCommand(GenlockStop{}), now);
    return;
  }
  const bool runs_free = config_.trigger.source == SyncSource::kNone;
  if (start && !runs_free && capture().genlock.state == GenlockState::kOff)
    ask_by_button(CaptureCommand(GenlockStart{}), now);
  ask_by_button(start ? TakeCommand(TakeRequest::Start{}) : TakeCommand(TakeRequest::Stop{}), now);
}

void Operation::ask_by_button(Command command, Instant now) {
  if (const auto asked = ask(button(), std::move(command), now); !asked) {
    news_.say(NewsKind::kRig, "the button did nothing: " + asked.error().message);
  }
}

void Operation::ask_to_end(std::string reason) {
  end_reason_ = std::move(reason);
  end_asked_.store(true, std::memory_order_release);
}

HeadShapes Operation::head_shapes() const {
  HeadShapes shapes;
  for (const HeadReport& head : capture().heads) {
    shapes.emplace_back();
    if (head.format) shapes.back() = HeadShape{head.format->pixels, head.format->width, head.format->height};
  }
  return shapes;
}

}  // namespace nodal::firmware
