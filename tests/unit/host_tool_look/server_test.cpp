// The page's server, asked over real sockets.
#include "host_tool/look/server.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>
#include <zlib.h>

#include <array>
#include <chrono>
#include <filesystem>
#include <memory>
#include <set>
#include <thread>

#include "host_tool/look/loopback.h"
#include "host_tool/look/page_files.h"
#include "tests/support/pictures.h"

namespace nodal::host::look {
namespace {

using std::chrono::milliseconds;

/// A connection of a client.
class Client {
 public:
  explicit Client(std::uint16_t port) : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(port);
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (::connect(fd_, reinterpret_cast<const sockaddr*>(&to), sizeof to) != 0) ADD_FAILURE() << "not connected";
  }
  ~Client() { ::close(fd_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  void send(const std::string& text) const { (void)!::send(fd_, text.data(), text.size(), MSG_NOSIGNAL); }
  /// What came until `until` is in it, the server closed, or `at_most` passed.
  std::string read(const std::string& until, milliseconds at_most = milliseconds(5000)) {
    const auto end = std::chrono::steady_clock::now() + at_most;
    while (came_.find(until) == std::string::npos && !closed_) {
      const auto left = std::chrono::duration_cast<milliseconds>(end - std::chrono::steady_clock::now());
      pollfd readable{fd_, POLLIN, 0};
      if (left.count() <= 0 || ::poll(&readable, 1, static_cast<int>(left.count())) <= 0) break;
      std::array<char, 65536> piece{};
      const ssize_t got = ::recv(fd_, piece.data(), piece.size(), 0);
      if (got <= 0) closed_ = true;
      if (got > 0) came_.append(piece.data(), static_cast<std::size_t>(got));
    }
    return came_;
  }
  bool closed(milliseconds at_most = milliseconds(5000)) {
    read("\x01 nothing like this comes", at_most);
    return closed_;
  }

 private:
  int fd_;
  std::string came_;
  bool closed_ = false;
};

class PageServer : public testing::Test {
 protected:
  PageServer() : loopback_(listen_on_loopback().value()) {}

  void start(const ServerLimits& limits = {}, bool changes = false) {
    rules_ = {loopback_.port, make_token().value(), changes};
    server_ = Server::start(
                  loopback_.socket.get(), rules_,
                  [this](const Wanted& wanted) {
                    ++answered_;
                    if (wanted.changes) return Answer::text(200, "you asked to change " + wanted.body);
                    const auto side = wanted.query.find("side");
                    return Answer::text(200, "you asked for " + wanted.name +
                                                 (side == wanted.query.end() ? "" : " of " + side->second));
                  },
                  limits)
                  .value();
  }
  std::string request(const std::string& name, const std::string& more = "") const {
    return "GET /" + rules_.token + "/" + name + " HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(loopback_.port) +
           "\r\n" + more + "\r\n";
  }
  /// The answer to bytes, of a connection that the server closes or not.
  std::string answer_to(const std::string& bytes, const std::string& until = "you asked") const {
    Client client(loopback_.port);
    client.send(bytes);
    return client.read(until);
  }
  /// Ticks until `holds`, for at most 10 s.
  template <class Holds>
  bool tick_until(const Holds& holds) {
    for (int k = 0; k < 500; ++k) {
      server_->tick();
      if (holds()) return true;
      std::this_thread::sleep_for(milliseconds(20));
    }
    return false;
  }

  Loopback loopback_;
  Rules rules_;
  std::unique_ptr<Server> server_;
  int answered_ = 0;
};

TEST_F(PageServer, ARequestWithTheToken_IsAnsweredWithTheHeadersThatKeepOthersOut) {
  start();
  const std::string answer = answer_to(request("picture?side=4096"), "4096");
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 200 ")) << answer;
  EXPECT_NE(answer.find("you asked for picture of 4096"), std::string::npos) << answer;
  EXPECT_NE(answer.find("Content-Security-Policy: default-src 'self';"), std::string::npos) << answer;
  EXPECT_NE(answer.find("X-Content-Type-Options: nosniff"), std::string::npos);
  EXPECT_NE(answer.find("Referrer-Policy: no-referrer"), std::string::npos) << "the link has the token";
  EXPECT_EQ(answer.find("Access-Control"), std::string::npos);
}

TEST_F(PageServer, OnlyThisComputer_ReachesIt) {
  sockaddr_in own{};
  socklen_t size = sizeof own;
  ASSERT_EQ(::getsockname(loopback_.socket.get(), reinterpret_cast<sockaddr*>(&own), &size), 0);
  EXPECT_EQ(own.sin_addr.s_addr, htonl(INADDR_LOOPBACK));
  EXPECT_NE(loopback_.port, 0);
}

TEST_F(PageServer, TwoTokens_AreDifferent) {
  const std::string a = make_token().value(), b = make_token().value();
  EXPECT_EQ(a.size(), 32u);
  EXPECT_NE(a, b);
}

TEST_F(PageServer, EachKindOfBadRequest_IsRefusedAndNeverReachesThePage) {
  start();
  const std::string port = std::to_string(loopback_.port), host = "Host: 127.0.0.1:" + port + "\r\n";
  const std::string begin = "GET /" + rules_.token + "/a HTTP/1.1\r\n";
  const std::string post = "POST /" + rules_.token + "/a HTTP/1.1\r\n";
  struct Case {
    std::string bytes, status;
  };
  const std::vector<Case> cases{
      {begin + "Host: evil.example:" + port + "\r\n\r\n", "421"},
      {begin + host + host + "\r\n", "421"},
      {begin + host + "Origin: https://evil.example\r\n\r\n", "403"},
      {post + host + "Content-Type: application/x-www-form-urlencoded\r\nContent-Length: 3\r\n\r\na=b", "400"},
      {post + host + "\r\n", "405"},
      {begin + host + "Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n", "400"},
      {begin + host + "Content-Length: 5\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n", "400"},
      {begin + host + "X-Long: " + std::string(40000, 'a') + "\r\n\r\n", "431"},
  };
  for (const Case& each : cases) {
    Client client(loopback_.port);
    client.send(each.bytes);
    EXPECT_TRUE(client.read("\r\n\r\n").starts_with("HTTP/1.1 " + each.status))
        << each.bytes.substr(0, 300) << client.read("");
    EXPECT_TRUE(client.closed()) << each.status << ": what follows must not be taken for a request";
  }
  EXPECT_EQ(answered_, 0);
}

TEST_F(PageServer, WithoutTheToken_TheConnectionEndsWithoutAByte) {
  start();
  for (const std::string path : {"/", "/scene.json", "/00000000000000000000000000000000/scene.json"}) {
    Client client(loopback_.port);
    client.send("GET " + path + " HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(loopback_.port) + "\r\n\r\n");
    EXPECT_EQ(client.read("HTTP"), "") << path;
    EXPECT_TRUE(client.closed()) << path;
  }
  EXPECT_EQ(answered_, 0);
}

TEST_F(PageServer, AHundredConnectionsThatSayNothing_DoNotKeepAPageOut) {
  start();
  std::vector<std::unique_ptr<Client>> silent;
  for (int k = 0; k < 100; ++k) {
    silent.push_back(std::make_unique<Client>(loopback_.port));
    if (k % 2 == 0) silent.back()->send("GET /");  // half a request
  }
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_NE(answer_to(request("scene.json")).find("you asked for scene.json"), std::string::npos);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, milliseconds(4000));
}

TEST_F(PageServer, ARequestThatNeverGetsWhole_IsClosed) {
  start({.idle = milliseconds(200)});
  Client client(loopback_.port);
  client.send("GET /" + rules_.token);
  EXPECT_TRUE(tick_until([&] { return client.closed(milliseconds(5)) && client.read("").empty(); }));
}

TEST_F(PageServer, PagesAreCounted_WhileTheyAreOpen_AndTheLastOnesEndIsNoticed) {
  start({.heartbeat = milliseconds(50)});
  EXPECT_EQ(server_->without_page(), milliseconds(0)) << "none was open yet: the user may still read the link";
  {
    Client page(loopback_.port);
    page.send(request("events"));
    EXPECT_NE(page.read("text/event-stream").find("200"), std::string::npos);
    ASSERT_TRUE(tick_until([&] { return server_->pages() == 1; }));
    const std::string once = page.read(": the program is there");
    EXPECT_TRUE(tick_until([&] { return page.read("\x01", milliseconds(5)).size() > once.size() + 60; }))
        << "heartbeats go on";
    EXPECT_EQ(server_->without_page(), milliseconds(0));
  }
  EXPECT_TRUE(tick_until([&] { return server_->pages() == 0; })) << "the page was closed";
  EXPECT_TRUE(tick_until([&] { return server_->without_page() > milliseconds(100); }));
}

TEST_F(PageServer, MorePagesThanABrowserHasConnections_AreRefusedInASentence) {
  start({.pages = 2, .heartbeat = milliseconds(50)});
  Client a(loopback_.port), b(loopback_.port), c(loopback_.port);
  a.send(request("events"));
  b.send(request("events"));
  ASSERT_TRUE(tick_until([&] { return server_->pages() == 2; }));
  c.send(request("events"));
  EXPECT_NE(c.read("open.").find("503"), std::string::npos);
  EXPECT_NE(c.read("open.").find("Too many pages"), std::string::npos);
}

TEST_F(PageServer, AChange_ArrivesWhole_AlsoInPieces) {
  start({}, true);
  const std::string port = std::to_string(loopback_.port), body(60'000, 'x');
  Client client(loopback_.port);
  client.send("POST /" + rules_.token + "/change HTTP/1.1\r\nHost: 127.0.0.1:" + port +
              "\r\nOrigin: http://127.0.0.1:" + port +
              "\r\nContent-Type: application/json\r\nContent-Length: 60001\r\n\r\n");
  client.send(body);
  EXPECT_EQ(client.read("you asked", milliseconds(300)), "") << "one byte is missing";
  client.send("y");
  EXPECT_NE(client.read(body + "y").find("you asked to change " + body + "y"), std::string::npos);
  EXPECT_EQ(answered_, 1);
}

TEST_F(PageServer, AChangeThatNeverGetsWhole_IsClosedAndChangesNothing) {
  start({.idle = milliseconds(200)}, true);
  const std::string port = std::to_string(loopback_.port);
  Client client(loopback_.port);
  client.send("POST /" + rules_.token + "/change HTTP/1.1\r\nHost: 127.0.0.1:" + port +
              "\r\nOrigin: http://127.0.0.1:" + port +
              "\r\nContent-Type: application/json\r\nContent-Length: 50\r\n\r\n{");
  EXPECT_TRUE(tick_until([&] { return client.closed(milliseconds(5)) && client.read("").empty(); }));
  EXPECT_EQ(answered_, 0);
}

TEST_F(PageServer, ItEndsWhilePagesAreOpen) {
  start({.heartbeat = milliseconds(50)});
  Client page(loopback_.port);
  page.send(request("events"));
  ASSERT_TRUE(tick_until([&] { return server_->pages() == 1; }));
  server_.reset();
  EXPECT_TRUE(page.closed());
}

TEST(PageFiles, ThePageIsInTheProgram_AndNamesNoOtherServer) {
  const std::optional<Answer> page = page_file("");
  ASSERT_TRUE(page);
  EXPECT_EQ(page->type, "text/html; charset=utf-8");
  for (const std::string name : {"index.html", "main.js", "style.css", "icon.svg", "vendor/viewer.js"}) {
    const std::optional<Answer> file = page_file(name);
    ASSERT_TRUE(file) << name;
    EXPECT_FALSE(file->body->empty()) << name;
    const std::string text(file->body->begin(), file->body->end());
    if (name == "index.html") {
      EXPECT_EQ(text.find("http"), std::string::npos);
    }
  }
  // Every file that the page has, as it is, and all of them small.
  std::size_t compressed = 0;
  const std::filesystem::path folder = NODAL_SOURCE_DIR "/host_tool/page";
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const std::string name = std::filesystem::relative(entry.path(), folder).string(),
                      ending = entry.path().extension();
    if (!std::set<std::string>{".html", ".css", ".js", ".svg"}.contains(ending) || name == "vendor/entry.js") continue;
    const std::optional<Answer> file = page_file(name);
    ASSERT_TRUE(file) << name;
    EXPECT_TRUE(*file->body == test::read_bytes(entry.path())) << name;
    uLongf size = compressBound(file->body->size());
    std::vector<std::uint8_t> small(size);
    ASSERT_EQ(compress2(small.data(), &size, file->body->data(), file->body->size(), 9), Z_OK);
    compressed += size;
  }
  EXPECT_LT(compressed, 250'000U);
  EXPECT_EQ(page_file("main.js")->type, "text/javascript; charset=utf-8");
  EXPECT_FALSE(page_file("../vendor/update"));
  EXPECT_FALSE(page_file("vendor/package.json"));
}

}  // namespace
}  // namespace nodal::host::look
