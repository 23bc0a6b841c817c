#include "firmware/hosts/control.h"

#include "firmware/hosts/wire_commands.h"

namespace nodal::firmware {
namespace {

// A host that stays is in the log. One that asks something and leaves is not: the audit log has what it changed.
constexpr Duration kLoggedAfter = Duration::seconds(10);

/// Temporary settings end with the host that made them: when its link ends, and when it does not answer pings.
void watch_leases(const Clients& clients, Operation& operation, Instant now) {
  for (const auto& client : clients) {
    const bool over = client->finished() || client->activity().silence(now) > HostActivity::kLeaseSilent;
    if (!client->leases || !over) continue;
    client->leases = false;
    operation.end_lease(client->number(), client->who());
  }
}

}  // namespace

// All links may wait in a queue.
static_assert(Admission::in_all(Admission::kMaxLinks) <= FairQueue::kMaxWaiting);
static_assert(Admission::places(Admission::kMaxLinks, Access::kControl) <= kMaxWaitingTickets);

Control::Control(const RigConfig& config, std::string software, const Stages& stages, Outlet<SetLoan>& frame_sets,
                 std::vector<Listener> listeners, hal::WatchdogPort* watchdog, const PanelPins& panel, DeviceScan* scan,
                 Instant now)
    : config_(config),
      software_(std::move(software)),
      stages_(stages),
      operation_(config, stages, watchdog, panel, now),
      admission_(std::move(listeners)),
      started_(now),
      replies_(config_, clients_),
      devices_(scan),
      uploads_(UploadLimits{kMaxCalibrationBytes, kUploadsOfAClient * Admission::kMaxClients, kUploadsOfAClient}),
      publisher_(config.raymap, stages.encoder.published()),
      frame_sender_(config, frame_sets, stages.blender),
      take_sender_(stages.take_reader) {}

Control::~Control() = default;

bool Control::step(Instant now) {
  now_ = now;
  operation_.begin_step(now);
  bool busy = false;
  if (!operation_.asked_to_end()) {
    busy = admission_.accept(
        clients_, [this](Access access) { return hello(access); }, now);
  }
  busy |= serve_all(now);
  busy |= serve_turns(now);
  admission_.close_excess(clients_, now);
  const std::vector<Answer> answers = operation_.take_answers(now);
  for (const Answer& answer : answers) {
    calibrations_.end(answer.ticket);
    replies_.settle(answer, now);
  }
  busy |= !answers.empty();
  NODAL_ASSERT(replies_.waiting() <= operation_.unanswered());  // else a request would wait for ever
  busy |= devices_.step(clients_, replies_, now);
  stages_.encoder.set_wanted(Publisher::jpeg_wanted(clients_), Publisher::pixels_wanted(clients_));
  busy |= publisher_.step(clients_);
  for (const std::string& sentence : publisher_.take_news()) say(NewsKind::kHosts, sentence);
  busy |= frame_sender_.step(clients_, frame_sets_.highest(), now);
  busy |= take_sender_.step(clients_, now);
  for (const auto& client : clients_) busy |= client->pump_out(now);
  watch_leases(clients_, operation_, now);
  drop_finished();
  operation_.end_step(Publisher::lossless_wanted(clients_), now);
  end(now);
  return busy;
}

void Control::add_wake_ups(hal::WakeUps& to) const {
  to.at(now_ + operation_.step_every());
  if (!operation_.asked_to_end()) admission_.add_wake_ups(clients_, to);
  for (const auto& client : clients_) client->add_wake_ups(to);
}

void Control::end(Instant now) {
  const std::string* const reason = operation_.end_reason();
  if (!reason) return;
  if (!ending_since_) {
    ending_since_ = now;
    for (const auto& client : clients_) client->end(Error{Errc::kLinkClosed, "the rig stops: " + *reason}, now);
  }
  if (clients_.empty() || now - *ending_since_ > kFarewell) ended_.store(true, std::memory_order_release);
}

wire::Hello Control::hello(Access access) const {
  wire::Hello hello = make_hello(software_);
  hello.set_rig_name(config_.name);
  for (const char* feature :
       {"audit", "audit-since", "calibration", "calibration-trial", "exposure", "exposure-programs", "frame-sets",
        "genlock", "hosts", "on-behalf", "raymap-jpeg", "raymap-raw", "temporary-settings"}) {
    hello.add_features(feature);
  }
  if (devices_.available()) hello.add_features("devices");
  if (stages_.takes != nullptr) hello.add_features("takes");
  if (config_.signers) hello.add_features("signed-calibrations");
  if (access != Access::kControl) hello.add_features(access == Access::kView ? "view-only" : "operate-only");
  if (const auto& in_force = operation_.keeper().in_force) hello.set_calibration_id(sha256_to_wire(*in_force));
  return hello;
}

void Control::drop_finished() {
  for (const auto& client : clients_) {
    if (client->ending()) client->presence().end();
  }
  std::erase_if(clients_, [&](const std::unique_ptr<Client>& client) {
    if (!client->finished()) return false;
    uploads_.leave(client->number());
    frame_sets_.leave(client->number());
    calibrations_.leave(client->number());
    devices_.leave(client->number());
    const bool left = client->why().code == Errc::kLinkClosed;
    if (!left) say(NewsKind::kHosts, client->name() + " was dropped: " + client->why().text());
    else if (!client->said_hello()) say(NewsKind::kHosts, client->name() + " left without saying hello");
    else if (client->logged) say(NewsKind::kHosts, client->name() + " left");
    return true;
  });
}

/// Serves another client first in each step, so that all get their share of common resources such as capture's queue.
bool Control::serve_all(Instant now) {
  if (clients_.empty()) return false;
  bool busy = false;
  first_served_ = (first_served_ + 1) % clients_.size();
  for (std::size_t i = 0; i < clients_.size(); ++i)
    busy |= serve(*clients_[(first_served_ + i) % clients_.size()], now);
  return busy;
}

bool Control::serve(Client& client, Instant now) {
  if (!client.logged && client.said_hello() && now - client.activity().since() >= kLoggedAfter) {
    client.logged = true;
    say(NewsKind::kHosts, client.name() + " is connected");
  }
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
    client.on_request(now);
    handle(client, *request, now);
  } else if (std::holds_alternative<wire::Hello>(event)) {
    client.on_hello(now);
  } else if (const auto* opened = std::get_if<StreamOpened>(&event)) {
    if (client.access() != Access::kControl) {
      client.session().stop_stream(opened->stream,
                                   {Errc::kUnsupported, "uploads are only possible at the rig's control socket"});
      return;
    }
    if (const Status may = Admission::may_work(clients_, client, now); !may) {
      client.session().stop_stream(opened->stream, may.error());
      return;
    }
    client.on_upload(opened->stream, now);  // a host opens streams only for uploads
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

}  // namespace nodal::firmware
