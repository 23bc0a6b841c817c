#include "host_tool/look/server.h"

#include <microhttpd.h>
#include <sys/socket.h>

#include <algorithm>
#include <cstring>

namespace nodal::host::look {
namespace {

constexpr std::size_t kMaxHeaderBytes = 16 << 10;
constexpr std::chrono::milliseconds kAskAgain{250};  // until an answer that waits for too long says so
constexpr std::string_view kBeat = ": the program is there\n\n";

/// Of every answer: the page loads nothing of others and is in no frame of others.
void add_headers(MHD_Response* response, const std::string& type) {
  const auto add = [&](const char* name, const char* value) { MHD_add_response_header(response, name, value); };
  add("Content-Type", type.c_str());
  add("Content-Security-Policy",
      "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; object-src 'none'");
  add("X-Content-Type-Options", "nosniff");
  add("Referrer-Policy", "no-referrer");
  add("Cross-Origin-Resource-Policy", "same-origin");
  add("Cross-Origin-Opener-Policy", "same-origin");
  add("Cache-Control", "no-store");
}

void free_body(void* body) { delete static_cast<std::shared_ptr<const std::vector<std::uint8_t>>*>(body); }

}  // namespace

struct Server::Calls {
  /// With their lengths, as they came.
  static MHD_Result header(void* into, MHD_ValueKind, const char* name, std::size_t name_size, const char* value,
                           std::size_t value_size) {
    static_cast<Asked*>(into)->headers.emplace_back(std::string(name, name_size),
                                                    value == nullptr ? "" : std::string(value, value_size));
    return MHD_YES;
  }
  static MHD_Result query(void* into, MHD_ValueKind, const char* name, const char* value) {
    static_cast<std::map<std::string, std::string>*>(into)->emplace(name, value == nullptr ? "" : value);
    return MHD_YES;
  }
  static MHD_Result request(void* server, MHD_Connection* connection, const char* url, const char* method,
                            const char* version, const char* data, std::size_t* upload, void** state) {
    auto* const of = static_cast<Server*>(server);
    Asked asked{method, url, version, {}};
    MHD_get_connection_values_n(connection, MHD_HEADER_KIND, &Calls::header, &asked);
    if (*state == nullptr) {  // the headers are there
      *state = new Request;
      return static_cast<MHD_Result>(of->begin(connection, asked));
    }
    auto* const request = static_cast<Request*>(*state);
    if (*upload == 0) return static_cast<MHD_Result>(of->answer(connection, asked, *request));
    if (request->body.size() + *upload > Rules::kMaxBody) return MHD_NO;
    request->body.append(data, *upload);
    *upload = 0;
    return MHD_YES;
  }
  static void completed(void* of, MHD_Connection* connection, void** state, MHD_RequestTerminationCode) {
    auto* const server = static_cast<Server*>(of);
    delete static_cast<Request*>(*state);
    *state = nullptr;
    const std::lock_guard lock(server->mutex_);
    if (const auto peer = server->peers_.find(connection); peer != server->peers_.end())
      peer->second = {peer->second.fd, false, Clock::now()};
  }
  static void connection(void* of, MHD_Connection* connection, void**, MHD_ConnectionNotificationCode what) {
    auto* const server = static_cast<Server*>(of);
    const std::lock_guard lock(server->mutex_);
    if (what == MHD_CONNECTION_NOTIFY_CLOSED) {
      server->peers_.erase(connection);
      return;
    }
    const MHD_ConnectionInfo* const info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
    server->peers_[connection] = {info == nullptr ? -1 : info->connect_fd, false, Clock::now()};
    server->make_room();
  }
  static ssize_t page_bytes(void* of, std::uint64_t, char* into, std::size_t room) {
    auto* const page = static_cast<Page*>(of);
    const std::lock_guard lock(page->server->mutex_);
    if (page->server->ending_) return MHD_CONTENT_READER_END_OF_STREAM;
    if (!page->due || room < kBeat.size()) {
      MHD_suspend_connection(page->connection);
      return 0;
    }
    page->due = false;
    std::memcpy(into, kBeat.data(), kBeat.size());
    return static_cast<ssize_t>(kBeat.size());
  }
  static void page_ended(void* of) {
    const std::unique_ptr<Page> page(static_cast<Page*>(of));
    Server& server = *page->server;
    const std::lock_guard lock(server.mutex_);
    server.pages_.remove(page.get());
    server.last_page_end_ = Clock::now();
  }
  static ssize_t piece_bytes(void* of, std::uint64_t, char* into, std::size_t room) {
    auto* const sending = static_cast<Sending*>(of);
    Server& server = *sending->server;
    const std::lock_guard lock(server.mutex_);
    if (server.ending_) return MHD_CONTENT_READER_END_WITH_ERROR;
    const std::optional<std::size_t> bytes = sending->pieces->read(into, room);
    if (!bytes) return MHD_CONTENT_READER_END_WITH_ERROR;
    if (*bytes == 0) server.suspend(sending->connection);
    return static_cast<ssize_t>(*bytes);
  }
  static void pieces_ended(void* of) { delete static_cast<Sending*>(of); }
  static void log(void*, const char*, va_list) {}  // strangers' mistakes are not the user's business
};

Answer Answer::text(unsigned status, const std::string& sentence) {
  return {status,
          "text/plain; charset=utf-8",
          std::make_shared<const std::vector<std::uint8_t>>(sentence.begin(), sentence.end()),
          {}};
}

Result<std::unique_ptr<Server>> Server::start(int socket, Rules rules, Respond respond, const ServerLimits& limits) {
  std::unique_ptr<Server> made(new Server(std::move(rules), std::move(respond), limits));
  // Some connections beyond the limit, which stay until make_room()'s shutdown is noticed.
  made->daemon_ = MHD_start_daemon(
      MHD_USE_POLL_INTERNAL_THREAD | MHD_ALLOW_SUSPEND_RESUME | MHD_USE_ERROR_LOG, 0, nullptr, nullptr, &Calls::request,
      made.get(), MHD_OPTION_EXTERNAL_LOGGER, &Calls::log, nullptr, MHD_OPTION_LISTEN_SOCKET, socket,
      MHD_OPTION_CONNECTION_LIMIT, limits.connections + 16U, MHD_OPTION_CONNECTION_MEMORY_LIMIT, kMaxHeaderBytes,
      MHD_OPTION_CONNECTION_TIMEOUT, 60U, MHD_OPTION_STRICT_FOR_CLIENT, 1, MHD_OPTION_NOTIFY_COMPLETED,
      &Calls::completed, made.get(), MHD_OPTION_NOTIFY_CONNECTION, &Calls::connection, made.get(), MHD_OPTION_END);
  if (made->daemon_ == nullptr) return fail(Errc::kIo, "the page's server could not be started");
  return made;
}

Server::~Server() {
  if (daemon_ == nullptr) return;
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
    for (const Page* page : pages_) MHD_resume_connection(page->connection);
    resume_waiting();
    for (const Work& work : works_) MHD_resume_connection(work.connection);
    works_.clear();
    work_there_.notify_all();
  }
  if (worker_.joinable()) worker_.join();
  // libmicrohttpd would close the socket, which is the caller's.
  MHD_quiesce_daemon(daemon_);
  MHD_stop_daemon(daemon_);
}

void Server::tick() {
  const Clock::time_point now = Clock::now();
  const std::lock_guard lock(mutex_);
  if (now - asked_again_ >= kAskAgain) {
    asked_again_ = now;
    ++wakes_;
    resume_waiting();
  }
  for (const auto& [connection, peer] : peers_) {
    if (!peer.busy && now - peer.since > limits_.idle) ::shutdown(peer.fd, SHUT_RDWR);
  }
  if (now - beat_ < limits_.heartbeat) return;
  beat_ = now;
  for (Page* page : pages_) {
    page->due = true;
    MHD_resume_connection(page->connection);
  }
}

std::chrono::milliseconds Server::without_page() const {
  const std::lock_guard lock(mutex_);
  if (!had_page_ || !pages_.empty()) return {};
  return std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - last_page_end_);
}

unsigned Server::pages() const {
  const std::lock_guard lock(mutex_);
  return static_cast<unsigned>(pages_.size());
}

void Server::make_room() {
  if (peers_.size() <= limits_.connections) return;
  const auto by_age = [](const auto& a, const auto& b) {
    return std::pair(a.second.busy, a.second.since) < std::pair(b.second.busy, b.second.since);
  };
  Peer& oldest = std::ranges::min_element(peers_, by_age)->second;
  if (!oldest.busy) ::shutdown(oldest.fd, SHUT_RDWR);
  oldest.since = Clock::now();
}

MHD_Response* Server::response_of(MHD_Connection* connection, const Answer& answer) {
  if (answer.pieces != nullptr) {
    constexpr std::size_t kBlock = 64 << 10;
    auto* const sending = new Sending{this, connection, answer.pieces};
    MHD_Response* const response = MHD_create_response_from_callback(answer.pieces->size(), kBlock, &Calls::piece_bytes,
                                                                     sending, &Calls::pieces_ended);
    if (response == nullptr) delete sending;
    return response;
  }
  auto* const kept = new std::shared_ptr(answer.body);
  MHD_Response* const response = MHD_create_response_from_buffer_with_free_callback_cls(
      (*kept)->size(), const_cast<std::uint8_t*>((*kept)->data()), &free_body, kept);
  if (response == nullptr) free_body(kept);
  return response;
}

int Server::queue(MHD_Connection* connection, const Answer& answer, bool last) {
  MHD_Response* const response = response_of(connection, answer);
  if (response == nullptr) return MHD_NO;
  add_headers(response, answer.type);
  if (answer.status == 405)
    MHD_add_response_header(response, "Allow", rules_.changes ? "GET, HEAD, POST" : "GET, HEAD");
  for (const auto& [name, value] : answer.headers) MHD_add_response_header(response, name.c_str(), value.c_str());
  if (last) MHD_add_response_header(response, "Connection", "close");
  const MHD_Result queued = MHD_queue_response(connection, answer.status, response);
  MHD_destroy_response(response);
  return queued;
}

int Server::begin_page(MHD_Connection* connection) {
  auto* const page = new Page{this, connection, true};
  {
    const std::lock_guard lock(mutex_);
    pages_.push_back(page);
    had_page_ = true;
  }
  MHD_Response* const response =
      MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, 512, &Calls::page_bytes, page, &Calls::page_ended);
  if (response == nullptr) {
    Calls::page_ended(page);
    return MHD_NO;
  }
  add_headers(response, "text/event-stream");
  const MHD_Result queued = MHD_queue_response(connection, 200, response);
  MHD_destroy_response(response);
  return queued;
}

int Server::begin(MHD_Connection* connection, const Asked& asked) {
  const std::optional<Refusal> refusal = rules_.check(asked);
  if (!refusal) return MHD_YES;
  // An answer at this point ends the connection: whatever follows the headers is not read.
  return refusal->status == 0 ? MHD_NO : queue(connection, Answer::text(refusal->status, refusal->why), true);
}

int Server::answer(MHD_Connection* connection, const Asked& asked, Request& request) {
  std::uint64_t wakes = 0;
  {
    const std::lock_guard lock(mutex_);
    if (ending_) return MHD_NO;
    peers_[connection].busy = true;
    wakes = wakes_;
  }
  if (request.worked) return queue(connection, *request.worked, false);
  const Clock::time_point now = Clock::now();
  if (!request.complete) request.complete = now;
  Wanted wanted{
      rules_.name(asked), {},    asked.method == "POST",
      request.body,       asked, std::chrono::duration_cast<std::chrono::milliseconds>(now - *request.complete)};
  if (wanted.name == "events" && asked.method == "GET" && limits_.pages > 0) {
    if (pages() < limits_.pages) return begin_page(connection);
    return queue(connection, Answer::text(503, "Too many pages of this are open."), false);
  }
  MHD_get_connection_values(connection, MHD_GET_ARGUMENT_KIND, &Calls::query, &wanted.query);
  Answer made = respond_(wanted);
  if (made.work) {
    if (work(connection, request, std::move(made.work))) return MHD_YES;
    return queue(connection, Answer::text(503, "The program is busy; try again in a moment."), false);
  }
  if (!made.waits) return queue(connection, made, false);
  const std::lock_guard lock(mutex_);
  suspend(connection);
  if (wakes_ != wakes) resume_waiting();  // what it waits for came meanwhile
  return MHD_YES;
}

void Server::suspend(MHD_Connection* connection) {
  MHD_suspend_connection(connection);
  waiting_.push_back(connection);
}

void Server::wake() {
  const std::lock_guard lock(mutex_);
  ++wakes_;
  resume_waiting();
}

void Server::resume_waiting() {
  for (MHD_Connection* connection : std::exchange(waiting_, {})) MHD_resume_connection(connection);
}

bool Server::work(MHD_Connection* connection, Request& request, std::function<Answer()> make) {
  const std::lock_guard lock(mutex_);
  if (ending_ || works_.size() >= limits_.jobs) return false;
  if (!worker_.joinable()) worker_ = std::thread([this] { run_works(); });
  MHD_suspend_connection(connection);
  works_.push_back({connection, &request, std::move(make)});
  work_there_.notify_one();
  return true;
}

void Server::run_works() {
  std::unique_lock lock(mutex_);
  while (!ending_) {
    if (works_.empty()) {
      work_there_.wait(lock);
      continue;
    }
    const Work next = std::move(works_.front());
    works_.pop_front();
    lock.unlock();
    Answer made = next.make();
    lock.lock();
    next.request->worked = std::move(made);  // its connection is suspended, so that it is still there
    MHD_resume_connection(next.connection);
  }
}

}  // namespace nodal::host::look
