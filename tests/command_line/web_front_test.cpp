// `nodal-web front` with a real nginx: its site serves, pairs and refuses; disabled, it leaves nothing.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/stat.h>

#include <algorithm>
#include <cctype>
#include <csignal>

#include "web_rig.h"

namespace nodal::command_line {
namespace {

namespace fs = std::filesystem;

bool has(const std::string& program) {
  return Process({"/bin/sh", "-c", "PATH=$PATH:/usr/sbin; command -v " + program}).wait().code == 0;
}

/// A port of 127.0.0.1 that was free a moment ago.
int free_port() {
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof at;
  auto* const any = reinterpret_cast<sockaddr*>(&at);
  EXPECT_EQ(::bind(fd, any, size), 0);
  EXPECT_EQ(::getsockname(fd, any, &size), 0);
  ::close(fd);
  return ntohs(at.sin_port);
}

class WebFront : public WebTest {
 protected:
  void SetUp() override {
    for (const char* const program : {"nginx", "curl", "openssl"}) {
      if (!has(program)) GTEST_SKIP() << program << " is not installed";
    }
    for (const char* const folder : {"nginx", "nginx/sites-available", "nginx/sites-enabled", "avahi"})
      fs::create_directory(path(folder));
    write("nginx/nginx.conf", configuration(""));
  }
  std::string configuration(const std::string& more) const {
    std::string text = "daemon off;\nuser root;\npid " + path("nginx/pid") + ";\nerror_log " + path("nginx/log") +
                       ";\nevents {}\nhttp {\n  access_log off;\n" + more;
    for (const char* const kind : {"client_body", "proxy", "fastcgi", "uwsgi", "scgi"})
      text += "  " + std::string(kind) + "_temp_path " + path("nginx/temp") + ";\n";
    return text + "  include " + path("nginx/sites-enabled") + "/*;\n}\n";
  }
  Finished front(Words words) const {
    words.insert(words.begin(), "front");
    words.insert(words.end(), {"--nginx", path("nginx"), "--conf", path("conf"), "--avahi", path("avahi")});
    return nodal_web(words);
  }
  Finished enable(const Words& more = {}) const {
    Words words{"enable", "--name", "rig.test", "--listen", "127.0.0.1", "--port", port_, "--socket", path("web.sock")};
    words.insert(words.end(), more.begin(), more.end());
    return front(words);
  }
  /// The status and the body of an answer through nginx. curl checks the certificate and its names.
  std::pair<std::string, std::string> curl(const std::string& name, Words more = {}) const {
    Words words{"curl",
                "-s",
                "--cacert",
                path("conf/web.crt"),
                "--resolve",
                "*:" + port_ + ":127.0.0.1",
                "-w",
                "\n%{http_code}",
                "https://rig.test:" + port_ + "/" + name};
    words.insert(words.end(), more.begin(), more.end());
    const Finished done = Process(words).wait();
    EXPECT_EQ(done.code, 0) << name << " " << done.err;
    const std::size_t last = done.out.rfind('\n');
    return {done.out.substr(last + 1), done.out.substr(0, last)};
  }
  std::string pair_with(const std::string& code) const {
    return curl("api/pair", {"-H", "Content-Type: application/json", "-H", "Origin: https://rig.test:" + port_, "-c",
                             path("cookies"), "-d", R"({"code": ")" + code + R"(", "name": "phone"})"})
        .first;
  }
  /// Every file of nginx's and the front's folders.
  std::vector<std::string> files() const {
    std::vector<std::string> all;
    for (const char* const folder : {"nginx/sites-available", "nginx/sites-enabled", "conf", "avahi"}) {
      std::error_code none;
      for (const auto& each : fs::directory_iterator(path(folder), none)) all.push_back(each.path().string());
    }
    std::ranges::sort(all);
    return all;
  }

  std::string port_ = std::to_string(free_port());
};

TEST_F(WebFront, EnabledUsedAndDisabled_ServesThePageByItsCertificateAndLeavesNothing) {
  write("nginx/sites-enabled/other", "# of somebody else\n");
  const std::vector<std::string> before = files();
  const Finished enabled = enable();
  ASSERT_EQ(enabled.code, 0) << enabled.err;
  EXPECT_NE(enabled.out.find("127.0.0.1:" + port_ + ": https://rig.test:" + port_), std::string::npos) << enabled.out;
  struct stat key {};
  ASSERT_EQ(::stat(path("conf/web.key").c_str(), &key), 0);
  EXPECT_EQ(key.st_mode & 0777U, 0600U);
  EXPECT_EQ(enable().code, 1) << "enabled twice";

  start_nodald();
  bring_up();
  start_web();
  Process nginx({"/bin/sh", "-c", "PATH=$PATH:/usr/sbin; exec nginx -c " + path("nginx/nginx.conf")});
  ASSERT_TRUE(wait_until([&] {
    return Process({"curl", "-sk", "https://127.0.0.1:" + port_ + "/pair"}).wait().code == 0;
  })) << read("nginx/log");
  const auto page = curl("pair");
  EXPECT_EQ(page.first, "200") << page.second << read("nginx/log");
  EXPECT_EQ(curl("api/state").first, "401");
  EXPECT_EQ(curl("api/state", {"-H", "Host: evil.example"}).first, "421");
  EXPECT_EQ(curl("api/state", {"-H", "Host: 192.168.8.1", "-H", "X-Server-Addr: 192.168.8.1"}).first, "421")
      << "the address that a browser claims";

  const Finished link = nodal_web({"pair", "--conf", path("conf")});
  ASSERT_EQ(link.code, 0) << link.err;
  const std::string begin = "https://rig.test:" + port_ + "/pair#";
  ASSERT_TRUE(link.out.starts_with(begin)) << link.out;
  const Finished peer =
      Process({"openssl", "x509", "-in", path("conf/web.crt"), "-noout", "-fingerprint", "-sha256"}).wait();
  const std::string hash = peer.out.substr(peer.out.find('=') + 1, 95);
  EXPECT_NE(link.err.find(hash), std::string::npos) << link.err << hash;
  EXPECT_EQ(pair_with(link.out.substr(begin.size(), 32)), "200");
  EXPECT_EQ(curl("api/state", {"-b", path("cookies")}).first, "200");
  EXPECT_TRUE(curl("live?after=0", {"-b", path("cookies")}).second.starts_with("\xFF\xD8\xFF"));
  std::vector<std::string> guesses;
  for (int k = 0; k < 8; ++k) guesses.push_back(pair_with(std::string(32, 'e')));
  EXPECT_NE(std::ranges::find(guesses, "429"), guesses.end()) << "codes may be tried once a second";

  nginx.signal(SIGTERM);
  nginx.wait();
  const Finished disabled = front({"disable"});
  EXPECT_EQ(disabled.code, 0) << disabled.err;
  EXPECT_EQ(files(), before);
  EXPECT_FALSE(fs::exists(path("conf")));
  EXPECT_EQ(front({"disable"}).code, 1);
}

TEST_F(WebFront, ListeningEverywhere_IsAnnouncedUntilItIsDisabled) {
  const Finished enabled = front({"enable", "--port", port_, "--socket", path("web.sock")});
  ASSERT_EQ(enabled.code, 0) << enabled.err;
  const std::string service = read("avahi/nodal-web.service");
  EXPECT_NE(service.find("<type>_nodal._tcp</type><port>" + port_ + "</port>"), std::string::npos) << service;
  EXPECT_NE(enabled.out.find("nodal rigs"), std::string::npos) << enabled.out;
  EXPECT_EQ(front({"disable"}).code, 0);
  EXPECT_EQ(files(), std::vector<std::string>());
  ASSERT_EQ(enable().code, 0);
  EXPECT_FALSE(fs::exists(path("avahi/nodal-web.service"))) << "one address only is not announced at all";
}

TEST_F(WebFront, WhatNginxOrTheSystemRefuses_IsSaidAndNothingIsLeft) {
  write("nginx/nginx.conf", configuration("  no_such_word on;\n"));
  const Finished refused = enable();
  EXPECT_EQ(refused.code, 1);
  EXPECT_NE(refused.err.find("no_such_word"), std::string::npos) << refused.err;
  EXPECT_EQ(files(), std::vector<std::string>());

  write("nginx/nginx.conf", configuration(""));
  write("nginx/sites-available/nodal-web", "# of somebody else\n");
  EXPECT_NE(enable().err.find("is there already"), std::string::npos);
  EXPECT_EQ(read("nginx/sites-available/nodal-web"), "# of somebody else\n");
  EXPECT_EQ(files().size(), 1u);
  fs::remove(path("nginx/sites-available/nodal-web"));
  for (const Words& wrong : {Words{"--name", "a; b"}, Words{"--name", "-x"}, Words{"--certificate", path("six.json")},
                             Words{"--certificate", path("six.json"), "--key", path("six.json")},
                             Words{"--listen", "rig.test"}, Words{"--socket", "web.sock"}}) {
    EXPECT_NE(enable(wrong).code, 0) << wrong.front() << " " << wrong.back();
    EXPECT_EQ(files(), std::vector<std::string>()) << wrong.front();
  }
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  at.sin_port = htons(static_cast<std::uint16_t>(std::stoi(port_)));
  ASSERT_EQ(::bind(fd, reinterpret_cast<const sockaddr*>(&at), sizeof at), 0);
  ASSERT_EQ(::listen(fd, 1), 0);
  EXPECT_NE(enable().err.find("port " + port_ + " is in use"), std::string::npos);
  ::close(fd);
}

}  // namespace
}  // namespace nodal::command_line
