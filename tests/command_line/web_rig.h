// A nodal-web in front of a real nodald, and requests to its Unix socket.
#pragma once

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstring>

#include "rig_process.h"

namespace nodal::command_line {

class WebTest : public RigTest {
 public:
  /// A connection to the server; the caller closes it.
  int connected() const {
    const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_un to{};
    to.sun_family = AF_UNIX;
    std::strncpy(to.sun_path, path("web.sock").c_str(), sizeof to.sun_path - 1);
    (void)::connect(fd, reinterpret_cast<const sockaddr*>(&to), sizeof to);
    return fd;
  }

 protected:
  WebTest() {
    std::string toml = read("rig.toml");
    const std::string control = "unix = \"nodal.sock\"\n";
    toml.replace(toml.find(control), control.size(), control + "operate = \"operate.sock\"\n");
    write("rig.toml", toml);
    std::filesystem::create_directory(path("state"));
  }

  void start_web() {
    web_.reset();
    web_ = std::make_unique<Process>(Words{NODAL_BIN_DIR "/nodal-web", "serve", "--socket", path("web.sock"), "--rig",
                                           "unix:" + path("operate.sock"), "--state", path("state"), "--name",
                                           "rig.test"});
    ASSERT_TRUE(wait_until([&] { return ask("GET", "pair").starts_with("HTTP/1.1 200"); })) << web_->complained();
  }
  Finished nodal_web(Words words) const {
    words.insert(words.begin(), NODAL_BIN_DIR "/nodal-web");
    words.insert(words.end(), {"--state", path("state")});
    return Process(words).wait();
  }

  /// What bytes are answered with, until the server closes or says nothing for so long.
  std::string send(const std::string& bytes, int patience_s = 30) const {
    const int fd = connected();
    std::string came;
    const timeval patience{patience_s, 0};
    ::setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    (void)!::send(fd, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    std::array<char, 65536> piece{};
    for (ssize_t got = 1; (got = ::recv(fd, piece.data(), piece.size(), 0)) > 0;)
      came.append(piece.data(), static_cast<std::size_t>(got));
    ::close(fd);
    return came;
  }
  std::string ask(const std::string& method, const std::string& name, const std::string& headers = "",
                  const std::string& body = "") const {
    return send(method + " /" + name + " HTTP/1.1\r\nHost: rig.test\r\nConnection: close\r\n" + headers + "\r\n" +
                body);
  }
  static std::string cookie(const std::string& secret) { return "Cookie: __Host-nodal=" + secret + "\r\n"; }
  std::string get(const std::string& name, const std::string& headers = "") const {
    return ask("GET", name, cookie(secret_) + headers);
  }
  std::string post(const std::string& name, const std::string& body, const std::string& secret) const {
    return ask("POST", name,
               cookie(secret) + "Origin: https://rig.test\r\nContent-Type: application/json\r\nContent-Length: " +
                   std::to_string(body.size()) + "\r\n",
               body);
  }
  static std::string status(const std::string& answer) { return answer.substr(0, answer.find("\r\n")).substr(9, 3); }
  static std::string body_of(const std::string& answer) {
    const std::size_t end = answer.find("\r\n\r\n");
    return end == std::string::npos ? "" : answer.substr(end + 4);
  }
  static std::string header(const std::string& answer, const std::string& name) {
    const std::size_t at = answer.find("\r\n" + name + ": ");
    if (at == std::string::npos || at > answer.find("\r\n\r\n")) return "";
    const std::size_t begin = at + name.size() + 4;
    return answer.substr(begin, answer.find("\r\n", begin) - begin);
  }
  std::string code(const Words& more = {}) const {
    Words words{"pair", "--at", "https://rig.test/"};
    words.insert(words.end(), more.begin(), more.end());
    const Finished made = nodal_web(words);
    EXPECT_EQ(made.code, 0) << made.err;
    const std::string begin = "https://rig.test/pair#";
    EXPECT_TRUE(made.out.starts_with(begin)) << made.out;
    return made.out.substr(begin.size(), 32);
  }
  /// The secret of a new device.
  std::string paired(const std::string& name, const Words& more = {}) const {
    const std::string answer = post("api/pair", R"({"code": ")" + code(more) + R"(", "name": ")" + name + "\"}", "");
    const std::string set = header(answer, "Set-Cookie");
    EXPECT_EQ(status(answer), "200") << answer;
    EXPECT_NE(set.find("; Path=/; Secure; HttpOnly; SameSite=Strict"), std::string::npos) << set;
    return set.substr(set.find('=') + 1, 64);
  }
  /// The status of a request for the pairing page of this host.
  std::string answer_to_host(const std::string& host) const {
    return status(send("GET /pair HTTP/1.1\r\nHost: " + host + "\r\nConnection: close\r\n\r\n"));
  }
  Json state() const { return Json::parse(body_of(get("api/state"))); }

  std::unique_ptr<Process> web_;
  std::string secret_;  ///< a device that may operate has it
};

}  // namespace nodal::command_line
