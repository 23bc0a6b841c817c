#include "firmware/operate/control.h"

#include <algorithm>

#include "firmware/hosts/status.h"

namespace nodal::firmware {
Control::Control(const RigConfig& config, std::string software, const Stages& stages, std::vector<Listener> listeners,
                 hal::WatchdogPort* watchdog, const PanelPins& panel, Instant now)
    : config_(config),
      software_(std::move(software)),
      stages_(stages),
      admission_(std::move(listeners)),
      started_(now),
      uploads_(UploadLimits{kMaxCalibrationBytes, kUploadsOfAClient * Admission::kMaxClients, kUploadsOfAClient}),
      publisher_(config.raymap, stages.encoder.published()),
      frame_sender_(config, stages.frame_sets, stages.blender),
      capture_(&stages.capture.snapshot().read()),
      keeper_(&stages.keeper.snapshot().read()),
      newest_set_(now),
      unwell_(now),
      supervisor_(watchdog),
      panel_(panel),
      news_(now) {}

Control::~Control() = default;

bool Control::step(Instant now) {
  capture_ = &stages_.capture.snapshot().read();
  keeper_ = &stages_.keeper.snapshot().read();
  news_.step(now);
  watch_trial(now);
  restore_settings();
  const bool open = !end_asked_.load(std::memory_order_acquire);
  bool busy = open && admission_.accept(
                          clients_, [this](Access access) { return hello(access); }, now);
  busy |= serve_all(now);
  admission_.make_room(clients_, now);
  busy |= take_answers(now);
  remember_settings(now);
  answer_settings(now);
  stages_.encoder.set_wanted(Publisher::jpeg_wanted(clients_), Publisher::pixels_wanted(clients_));
  busy |= publisher_.step(clients_);
  for (const std::string& sentence : publisher_.take_news()) news_.say(NewsKind::kHosts, sentence);
  busy |= frame_sender_.step(clients_, now);
  for (const auto& client : clients_) busy |= client->pump_out(now);
  drop_finished();
  watch(now);
  tell_that_it_runs_well(now);
  end(now);
  step_panel(now);
  return busy;
}

void Control::ask_to_end(std::string reason) {
  end_reason_ = std::move(reason);
  end_asked_.store(true, std::memory_order_release);
}

void Control::end(Instant now) {
  if (!supervisor_.acts().end) return;
  if (!ending_since_) {
    ending_since_ = now;
    for (const auto& client : clients_) client->end(Error{Errc::kLinkClosed, "the rig stops: " + end_reason_}, now);
  }
  if (clients_.empty() || now - *ending_since_ > kFarewell) ended_.store(true, std::memory_order_release);
}

std::vector<std::string> Control::take_news() { return news_.take(); }

wire::Hello Control::hello(Access access) const {
  wire::Hello hello = make_hello(software_);
  hello.set_rig_name(config_.name);
  for (const char* feature : {"audit", "calibration", "calibration-trial", "exposure", "exposure-programs",
                              "frame-sets", "genlock", "hosts", "raymap-jpeg", "raymap-raw"}) {
    hello.add_features(feature);
  }
  if (config_.signers) hello.add_features("signed-calibrations");
  if (access == Access::kView) hello.add_features("view-only");
  if (keeper_->in_force) hello.set_calibration_id(sha256_to_wire(*keeper_->in_force));
  return hello;
}

void Control::drop_finished() {
  std::erase_if(clients_, [&](const std::unique_ptr<Client>& client) {
    if (!client->finished()) return false;
    uploads_.leave(client->number());
    const bool left = client->why().code == Errc::kLinkClosed;
    news_.say(NewsKind::kHosts, client->name() + (left ? " left" : " was dropped: " + client->why().text()));
    return true;
  });
}

/// In turns: what all clients share, such as capture's queue of commands, goes to another one first in each step.
bool Control::serve_all(Instant now) {
  if (clients_.empty()) return false;
  bool busy = false;
  first_served_ = (first_served_ + 1) % clients_.size();
  for (std::size_t i = 0; i < clients_.size(); ++i)
    busy |= serve(*clients_[(first_served_ + i) % clients_.size()], now);
  return busy;
}

bool Control::serve(Client& client, Instant now) {
  const bool read = client.pump_in(now);
  int requests = 0;
  int events = 0;
  while (client.requests_open < kMaxRequests && requests < kRequestsAStep && events < kEventsAStep) {
    auto event = client.held ? std::optional<Event>(std::move(*client.held)) : client.session().next_event();
    client.held.reset();
    if (!event) break;
    if (auto* request = std::get_if<wire::Request>(&*event)) {
      if (!has_room(client, *request)) {
        client.held = std::move(*request);
        break;
      }
      ++requests;
    }
    ++events;
    handle(client, *event, now);
  }
  return read || events > 0;
}

void Control::handle(Client& client, Event& event, Instant now) {
  if (const auto* request = std::get_if<wire::Request>(&event)) {
    client.asked(now);
    handle(client, *request, now);
  } else if (std::holds_alternative<wire::Hello>(event)) {
    client.used(now);
    news_.say(NewsKind::kHosts, client.name() + " came");
  } else if (const auto* opened = std::get_if<StreamOpened>(&event)) {
    if (client.access() != Access::kControl) {
      client.session().stop_stream(opened->stream, {Errc::kUnsupported, "uploads need the rig's control socket"});
      return;
    }
    if (const Status may = Admission::may_work(clients_, client, now); !may) {
      client.session().stop_stream(opened->stream, may.error());
      return;
    }
    client.uploads[opened->stream];  // hosts open streams for uploads only
  } else if (const auto* piece = std::get_if<BulkPiece>(&event)) {
    const auto upload = client.uploads.find(piece->stream);
    if (upload == client.uploads.end()) return;
    if (const Status taken = upload->second.piece(*piece, uploads_); !taken) {
      client.session().stop_stream(piece->stream, taken.error());
      client.uploads.erase(upload);
    }
  } else if (const auto* closed = std::get_if<StreamClosed>(&event)) {
    client.uploads.erase(closed->stream);
  } else if (const auto* stopped = std::get_if<StreamStopped>(&event)) {
    const auto pull = client.pulls.find(stopped->stream);
    if (pull != client.pulls.end()) pull->second.ended = true;
  }
}

std::pair<Client*, Control::Open> Control::close(std::uint64_t ticket) {
  const auto found = open_.find(ticket);
  NODAL_ASSERT(found != open_.end());
  Open open = std::move(found->second);
  open_.erase(found);
  Client* client = find(open.client);
  if (client) {
    --client->requests_open;
    --(needs_keeper(open.request) ? client->with_keeper : client->with_capture);
  }
  return {client, std::move(open)};
}

bool Control::take_answers(Instant now) {
  bool any = false;
  while (auto answer = stages_.capture.answers().pop()) {
    take_answer(*answer, now);
    any = true;
  }
  while (auto answer = stages_.keeper.answers().pop()) {
    take_answer(std::move(*answer), now);
    any = true;
  }
  return any;
}

void Control::take_answer(const CaptureAnswer& answer, Instant now) {
  auto [client, open] = close(answer.ticket);
  audit(open, std::nullopt, answer.status, now);
  if (!answer.status) {
    if (open.client == kPanel) news_.say(NewsKind::kRig, "the button did nothing: " + answer.status.error().message);
    if (open.client == kNobody)
      news_.say(NewsKind::kRig, "a remembered setting is not made: " + answer.status.error().message);
    if (client) refuse(*client, open.request.id(), answer.status.error(), now);
    return;
  }
  // The program is stored even when the request names none: it may be rig.toml's, and after a restart the settings
  // of heads are made under "manual" first.
  if (open.request.has_exposure()) {
    open.request.mutable_exposure()->set_program(std::string(exposure_program_name(answer.exposure.settings.program)));
  }
  if (open.client != kNobody && settings_.remember(open.request, config_.heads.size())) settings_writer_.changed();
  if (!client) return;
  wire::Reply message;
  message.set_id(open.request.id());
  if (open.request.has_genlock()) {
    fill_genlock(config_, answer.genlock, *message.mutable_genlock());
  } else if (open.request.has_exposure()) {
    fill_exposure(answer.exposure, config_.heads.size(), *message.mutable_exposure());
  } else {
    message.mutable_done();
  }
  ++client->requests_open;
  unanswered_.push_back({client->number(), std::move(message)});
}

void Control::take_answer(KeeperAnswer answer, Instant now) {
  if (answer.ticket == kRunsWellTicket) return;
  if (answer.ticket == kRememberTicket) {
    const Status stored = answer.result ? Status() : fail(answer.result.error());
    if (!settings_writer_.ended(stored)) return;
    news_.say(NewsKind::kRig, stored ? "settings are stored again" : settings_writer_.problem());
    return;
  }
  const auto [client, open] = close(answer.ticket);
  const auto* done = answer.result ? std::get_if<KeeperAnswer::Done>(&*answer.result) : nullptr;
  audit(open, done ? done->in_force : keeper_->in_force, answer.result ? Status() : fail(answer.result.error()), now);
  if (!answer.result) news_.say(NewsKind::kHosts, "calibration refused: " + answer.result.error().text());
  if (!client) return;
  if (!answer.result) return refuse(*client, open.request.id(), answer.result.error(), now);
  wire::Reply message;
  message.set_id(open.request.id());
  if (const auto* listed = std::get_if<KeeperAnswer::Listed>(&*answer.result)) {
    fill_calibrations(*listed, *message.mutable_calibrations());
  } else if (auto* document = std::get_if<KeeperAnswer::Document>(&*answer.result)) {
    message.mutable_calibration()->set_id(sha256_to_wire(document->id));
    message.mutable_calibration()->set_json(std::move(document->json));
  } else {
    message.mutable_done();
  }
  reply(*client, message, now);
}

void Control::watch_trial(Instant now) {
  if (keeper_->trial.has_value() == on_trial_.has_value()) return;
  if (keeper_->trial) {
    on_trial_ = *keeper_->trial;
    news_.say(NewsKind::kRig, "calibration '" + keeper_->name + "' is on trial");
    return;
  }
  news_.say(NewsKind::kRig, keeper_->in_force == on_trial_->id
                                ? "the trial's calibration is kept"
                                : "the trial is over; back to calibration '" + keeper_->name + "'");
  if (keeper_->in_force != on_trial_->id && now >= on_trial_->until) {
    wire::Request end;
    end.mutable_trial_end();
    audit({kNobody, end, "the trial's time", "calibration " + to_hex(on_trial_->id).substr(0, 12) + " on trial"},
          keeper_->in_force, {}, now);
  }
  on_trial_.reset();
}

void Control::step_panel(Instant now) {
  const bool rolling = capture_->genlock.state != GenlockState::kOff && !supervisor_.acts().end;
  const auto action = panel_.step({health().state, rolling, capture_->sets}, now);
  if (action) act(*action, now);
  while (auto problem = panel_.take_problem()) news_.say(NewsKind::kRig, std::move(*problem));
}

void Control::act(PanelAction action, Instant now) {
  if (action == PanelAction::kMark) {
    marks_.push_back({capture_->sets == 0 ? 0 : capture_->sets - 1, now});
    if (marks_.size() > kMarksKept) marks_.pop_front();
    news_.say(NewsKind::kRig, "marked set " + std::to_string(marks_.back().set));
    return;
  }
  wire::Request request;
  const bool start = action == PanelAction::kStart;
  request.mutable_genlock()->set_action(start ? wire::GenlockRequest::START : wire::GenlockRequest::STOP);
  news_.say(NewsKind::kRig, start ? "the button starts the genlock" : "the button stops the genlock");
  if (const Status asked = set(kPanel, request); !asked) {
    news_.say(NewsKind::kRig, "the button did nothing: " + asked.error().message);
  }
}

/// Makes again what hosts had set before the start, as fast as capture takes it.
void Control::restore_settings() {
  if (!restoring_) {
    if (!keeper_->settings) return;
    restoring_.emplace();
    if (!keeper_->settings_problem.empty()) {
      news_.say(NewsKind::kRig, keeper_->settings_problem);
      settings_writer_.unreadable(keeper_->settings_problem);
    }
    if (keeper_->settings->empty()) return;
    const std::string& file = *keeper_->settings;
    auto settings =
        Settings::decode(std::span(reinterpret_cast<const std::uint8_t*>(file.data()), file.size()), config_.text_id);
    if (!settings) {
      news_.say(NewsKind::kRig, settings.error().message);
      // Another rig.toml is what somebody wanted; a file that cannot be read is not.
      if (settings.error().code != Errc::kWrongState) settings_writer_.unreadable(settings.error().message);
      return;
    }
    settings_ = std::move(*settings);
    for (wire::Request& request : settings_.requests()) restoring_->push_back(std::move(request));
    news_.say(NewsKind::kRig, "settings are as hosts left them");
  }
  while (!restoring_->empty()) {
    const Status asked = set(kNobody, restoring_->front());
    if (!asked && asked.error().code == Errc::kBusy) return;
    if (!asked) news_.say(NewsKind::kRig, "a remembered setting is not made: " + asked.error().message);
    restoring_->pop_front();
  }
}

void Control::remember_settings(Instant now) {
  if (!settings_writer_.due(now)) return;
  if (stages_.keeper.requests().push(
          KeeperRequest{kRememberTicket, KeeperRequest::Remember{settings_.encode(config_.text_id)}, {}})) {
    settings_writer_.begun(now);
  }
}

/// A host that sets something is told whether it was stored, unless that takes long or the next write is not due yet.
void Control::answer_settings(Instant now) {
  if (unanswered_.empty() || settings_writer_.worth_waiting(now)) return;
  for (Unanswered& waiting : std::exchange(unanswered_, {})) {
    Client* const client = find(waiting.client);
    if (!client) continue;
    --client->requests_open;
    if (!settings_writer_.problem().empty()) waiting.reply.set_not_stored(settings_writer_.problem());
    reply(*client, waiting.reply, now);
  }
}

Client* Control::find(std::uint64_t number) {
  const auto found =
      std::find_if(clients_.begin(), clients_.end(), [&](const auto& client) { return client->number() == number; });
  return found == clients_.end() ? nullptr : found->get();
}

void Control::reply(Client& client, const wire::Reply& message, Instant now) {
  if (client.session().error()) return;
  if (const Status sent = client.session().send(message); !sent && !client.session().error()) {
    client.end(sent.error(), now);  // it asks and does not read
  }
}

void Control::refuse(Client& client, std::uint64_t request, const Error& error, Instant now) {
  wire::Reply message;
  message.set_id(request);
  *message.mutable_error() = to_wire(error);
  reply(client, message, now);
}

}  // namespace nodal::firmware
