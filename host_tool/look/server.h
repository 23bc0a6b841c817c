// The HTTP server of the page, on libmicrohttpd.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "host_tool/look/request_rules.h"
#include "protocol/base/result.h"

struct MHD_Connection;
struct MHD_Daemon;
struct MHD_Response;

namespace nodal::host::look {

/// A body that comes in pieces, such as a file of a take.
class Pieces {
 public:
  virtual ~Pieces() = default;
  virtual std::uint64_t size() const = 0;
  /// Copies the next bytes, as many as there are room and bytes: 0 if there are none yet, and Server::wake() is called
  /// when there are; nothing when it has failed, and the connection is closed. Called on the server's thread.
  virtual std::optional<std::size_t> read(char* into, std::size_t room) = 0;
};

/// An answer's body; it is kept until it is sent.
struct Answer {
  unsigned status = 200;
  std::string type = "text/plain; charset=utf-8";
  std::shared_ptr<const std::vector<std::uint8_t>> body;
  std::vector<std::pair<std::string, std::string>> headers{};  ///< beside those of every answer; ASCII
  std::shared_ptr<Pieces> pieces{};                            ///< instead of the body
  std::function<Answer()> work{};  ///< if set, makes the answer on the server's worker thread, where it may wait
  bool waits = false;              ///< there is no answer yet: `respond` is called again after Server::wake()

  static Answer text(unsigned status, const std::string& sentence);
};

/// What was asked for: the path behind the token, the query, and what a POST says.
struct Wanted {
  std::string name;
  std::map<std::string, std::string> query;
  bool changes = false;  ///< a POST
  std::string body{};    ///< what a POST says
  Asked asked{};
  std::chrono::milliseconds waited{};  ///< since the request was complete; above 0 if its answer waits
};
using Respond = std::function<Answer(const Wanted& wanted)>;

struct ServerLimits {
  unsigned connections = 48;                   ///< beyond, the one that has been idle longest is closed
  unsigned pages = 4;                          ///< a browser opens 6 connections to a server, and each page keeps one
  std::chrono::milliseconds idle{10'000};      ///< the longest time until a request is whole
  std::chrono::milliseconds heartbeat{2'000};  ///< a page's connection gets bytes so often, so that its end is noticed
  std::size_t jobs = 16;                       ///< answers that wait for the worker thread; beyond, 503
};

/// Answers requests that Rules accept. A page keeps the request "events" open for as long as it is shown; so the server
/// knows how many pages there are.
///
/// Threading: start(), tick(), pages() and the destructor are thread-bound; `respond` runs on the server's thread, and
///   what may take long on a worker thread, one after the other.
/// Ownership: keeps the socket open until it ends, but does not close it.
/// Errors: start(): kIo.
class Server {
 public:
  using Clock = std::chrono::steady_clock;

  static Result<std::unique_ptr<Server>> start(int socket, Rules rules, Respond respond, const ServerLimits& limits);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// Call it several times a second: closes idle connections, sends heartbeats, asks again for answers that wait.
  void tick();
  /// Something that answers and pieces wait for may be there. For any thread, but without a lock that `respond` or
  /// Pieces::read() take.
  void wake();
  /// How long there has been no page, after there was one; 0 before the first page and while there is one.
  std::chrono::milliseconds without_page() const;
  unsigned pages() const;

 private:
  struct Peer {
    int fd = -1;
    bool busy = false;  ///< a request is being answered
    Clock::time_point since;
  };
  struct Page {
    Server* server = nullptr;
    MHD_Connection* connection = nullptr;
    bool due = true;
  };
  /// A request from its headers to the end of its answer.
  struct Request {
    std::string body;
    std::optional<Clock::time_point> complete;  ///< when all of it had come
    std::optional<Answer> worked;               ///< what the worker thread made
  };
  struct Work {
    MHD_Connection* connection = nullptr;
    Request* request = nullptr;
    std::function<Answer()> make;
  };
  /// Pieces on their way to a connection.
  struct Sending {
    Server* server = nullptr;
    MHD_Connection* connection = nullptr;
    std::shared_ptr<Pieces> pieces;
  };
  struct Calls;  // libmicrohttpd's callbacks

  Server(Rules rules, Respond respond, const ServerLimits& limits)
      : rules_(std::move(rules)), respond_(std::move(respond)), limits_(limits) {}
  int begin(MHD_Connection* connection, const Asked& asked);
  int answer(MHD_Connection* connection, const Asked& asked, Request& request);
  /// Suspends the connection until the worker thread has made the answer. False: too many wait already.
  bool work(MHD_Connection* connection, Request& request, std::function<Answer()> make);
  void run_works();
  void suspend(MHD_Connection* connection);
  void resume_waiting();
  int queue(MHD_Connection* connection, const Answer& answer, bool last);
  MHD_Response* response_of(MHD_Connection* connection, const Answer& answer);
  int begin_page(MHD_Connection* connection);
  void make_room();

  const Rules rules_;
  const Respond respond_;
  const ServerLimits limits_;
  MHD_Daemon* daemon_ = nullptr;
  mutable std::mutex mutex_;  ///< protects all below
  std::map<MHD_Connection*, Peer> peers_;
  std::list<Page*> pages_;
  Clock::time_point beat_, asked_again_, last_page_end_;
  bool had_page_ = false, ending_ = false;
  std::vector<MHD_Connection*> waiting_;  ///< suspended until wake()
  std::uint64_t wakes_ = 0;
  std::deque<Work> works_;
  std::condition_variable work_there_;
  std::thread worker_;  ///< started by the first work
};

}  // namespace nodal::host::look
