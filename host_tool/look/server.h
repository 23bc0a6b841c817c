// The HTTP server of the page, on libmicrohttpd.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "host_tool/look/request_rules.h"
#include "protocol/base/result.h"

struct MHD_Connection;
struct MHD_Daemon;

namespace nodal::host::look {

/// An answer's body; it is kept until it is sent.
struct Answer {
  unsigned status = 200;
  std::string type = "text/plain; charset=utf-8";
  std::shared_ptr<const std::vector<std::uint8_t>> body;
  std::vector<std::pair<std::string, std::string>> headers{};  ///< beside those of every answer; ASCII

  static Answer text(unsigned status, const std::string& sentence);
};

/// What was asked for: the path behind the token, the query, and what a POST says.
struct Wanted {
  std::string name;
  std::map<std::string, std::string> query;
  bool changes = false;  ///< a POST
  std::string body{};    ///< what a POST says
};
using Respond = std::function<Answer(const Wanted& wanted)>;

struct ServerLimits {
  unsigned connections = 48;                   ///< beyond, the one that has been idle longest is closed
  unsigned pages = 4;                          ///< a browser opens 6 connections to a server, and each page keeps one
  std::chrono::milliseconds idle{10'000};      ///< the longest time until a request is whole
  std::chrono::milliseconds heartbeat{2'000};  ///< a page's connection gets bytes so often, so that its end is noticed
};

/// Answers requests that Rules accept. A page keeps the request "events" open for as long as it is shown; so the server
/// knows how many pages there are.
///
/// Threading: start(), tick(), pages() and the destructor are thread-bound; `respond` runs on the server's thread.
/// Ownership: keeps the socket open until it ends, but does not close it.
/// Errors: start(): kIo.
class Server {
 public:
  using Clock = std::chrono::steady_clock;

  static Result<std::unique_ptr<Server>> start(int socket, Rules rules, Respond respond, const ServerLimits& limits);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// Call it several times a second: closes idle connections and sends heartbeats.
  void tick();
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
  struct Calls;  // libmicrohttpd's callbacks

  Server(Rules rules, Respond respond, const ServerLimits& limits)
      : rules_(std::move(rules)), respond_(std::move(respond)), limits_(limits) {}
  int begin(MHD_Connection* connection, const Asked& asked);
  int answer(MHD_Connection* connection, const Asked& asked, std::string body);
  int queue(MHD_Connection* connection, const Answer& answer, bool last) const;
  int begin_page(MHD_Connection* connection);
  void make_room();

  const Rules rules_;
  const Respond respond_;
  const ServerLimits limits_;
  MHD_Daemon* daemon_ = nullptr;
  mutable std::mutex mutex_;  ///< protects all below
  std::map<MHD_Connection*, Peer> peers_;
  std::list<Page*> pages_;
  Clock::time_point beat_, last_page_end_;
  bool had_page_ = false, ending_ = false;
};

}  // namespace nodal::host::look
