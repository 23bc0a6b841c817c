// nodal-web in front of a real nodald, by requests to its Unix socket: pairing, recording, downloads, hostile requests.
#include <algorithm>
#include <cerrno>
#include <csignal>

#include "web_rig.h"

namespace nodal::command_line {
namespace {

TEST_F(WebTest, APairedPhone_RecordsDownloadsWithResumeAndIsNamedInTheAuditLog) {
  start_rig_with_takes();
  start_web();
  EXPECT_EQ(status(ask("GET", "api/state")), "401");
  secret_ = paired("Anna's phone");
  EXPECT_EQ(state()["status"]["rig"], "six");
  EXPECT_EQ(state()["heads"].size(), 6u);
  EXPECT_GT(state()["status"]["recording"]["total_bytes"], 0);
  const std::string live = get("live?after=0");
  EXPECT_EQ(status(live), "200") << live.substr(0, 500);
  EXPECT_EQ(header(live, "X-Age-Of"), "mid-exposure");
  EXPECT_TRUE(body_of(live).starts_with("\xFF\xD8\xFF"));
  EXPECT_EQ(Json::parse(body_of(get("scene.json")))["layout"], "equirectangular");
  EXPECT_TRUE(body_of(get("mesh.glb?envelope=0")).starts_with("glTF"));

  EXPECT_EQ(Json::parse(body_of(post("api/record", R"({"on": true})", secret_)))["take"], 1);
  ASSERT_TRUE(wait_until([&] { return state()["status"]["recording"]["sets"] > 10; }));
  EXPECT_EQ(Json::parse(body_of(post("api/record", R"({"on": false})", secret_)))["take"], 1);
  const Json take = Json::parse(body_of(get("api/takes")))["takes"].at(0);
  EXPECT_EQ(take["state"], "complete");
  EXPECT_TRUE(body_of(get("thumbs/1")).starts_with("\xFF\xD8\xFF"));
  for (const Json& file : Json::parse(body_of(get("takes/1")))["files"]) {
    const std::string name = file["name"], on_disk = read("takes/000001/" + name);
    EXPECT_TRUE(body_of(get("takes/1/" + name)) == on_disk) << name;
    ASSERT_EQ(file["bytes"], on_disk.size());
  }
  const std::string film = read("takes/000001/cam0-0000.mkv"), half = std::to_string(film.size() / 2);
  const std::string rest = get("takes/1/cam0-0000.mkv", "Range: bytes=" + half + "-\r\n");
  EXPECT_EQ(status(rest), "206");
  EXPECT_EQ(header(rest, "Content-Range"),
            "bytes " + half + "-" + std::to_string(film.size() - 1) + "/" + std::to_string(film.size()));
  EXPECT_TRUE(body_of(rest) == film.substr(film.size() / 2));
  const std::string tag = header(rest, "ETag");
  EXPECT_EQ(status(get("takes/1/cam0-0000.mkv", "Range: bytes=0-9\r\nIf-Range: " + tag + "\r\n")), "206");
  EXPECT_EQ(status(get("takes/1/cam0-0000.mkv", "Range: bytes=0-9\r\nIf-Range: \"other\"\r\n")), "200");
  EXPECT_EQ(status(get("takes/1/cam0-0000.mkv", "Range: bytes=" + std::to_string(film.size()) + "-\r\n")), "416");

  const std::string metrics = body_of(get("metrics"));
  EXPECT_NE(metrics.find("\nnodal_up 1\n"), std::string::npos) << metrics;
  EXPECT_EQ(body_of(ask("GET", "metrics", "Authorization: Bearer " + secret_ + "\r\n")).substr(0, 15),
            metrics.substr(0, 15));
  EXPECT_EQ(body_of(ask("GET", "healthz")), "ok\n");
  const Json audit = nodal_json({"audit"}).at(0);
  EXPECT_NE(audit.dump().find("for \\\"Anna's phone (device 1)\\\""), std::string::npos) << audit.dump(1);

  nodald().signal(SIGKILL);
  nodald().wait();
  EXPECT_TRUE(wait_until([&] { return status(ask("GET", "healthz")) == "503"; }));
  EXPECT_NE(body_of(get("metrics")).find("\nnodal_up 0\n"), std::string::npos);
  start_nodald();
  EXPECT_TRUE(wait_until([&] { return status(get("api/state")) == "200"; })) << "it comes back by itself";
  web_->signal(SIGTERM);
  EXPECT_EQ(web_->wait().code, 0);
}

TEST_F(WebTest, WhoeverIsNotPaired_WhoeverOnlyWatches_AndOtherSites_ChangeAndSeeNothing) {
  start_rig_with_takes();
  start_web();
  const std::string used = code();
  const auto pair_with = [&](const std::string& digits) {
    return status(post("api/pair", R"({"code": ")" + digits + R"(", "name": "x"})", ""));
  };
  EXPECT_EQ(status(ask("GET", "pair")), "200") << "a previewer opens the link: the code is in no request";
  EXPECT_EQ(pair_with(used), "200");
  EXPECT_EQ(pair_with(used), "404") << "a used code";
  const std::string guest = paired("guest", {"--watch"});
  secret_ = paired("phone");
  const std::string json = "Content-Type: application/json\r\n", body = R"({"on": true})";
  const std::string length = "Content-Length: " + std::to_string(body.size()) + "\r\n",
                    ours = "Origin: https://rig.test\r\n";
  const std::vector<std::string> names{"",        "live?after=0",      "scene.json", "mesh.glb?envelope=0",
                                       "api/me",  "api/status",        "api/state",  "api/takes",
                                       "takes/1", "takes/1/take.json", "thumbs/1",   "metrics",
                                       "rig.js",  "rig.html"};
  for (const std::string& name : names) {
    for (const std::string& who : {std::string(), cookie(std::string(64, '0')), cookie(secret_.substr(1) + "0"),
                                   cookie(secret_ + "0"), cookie(secret_) + cookie(secret_),
                                   "Cookie: nodal=" + secret_ + "\r\n", "Authorization: Basic " + secret_ + "\r\n"}) {
      EXPECT_EQ(status(ask("GET", name, who)), "401") << name << " " << who;
    }
  }
  const auto post_as = [&](const std::string& headers) { return status(ask("POST", "api/record", headers, body)); };
  EXPECT_EQ(post_as(json + length + ours), "401") << "nobody";
  EXPECT_EQ(post_as(json + length + ours + "Authorization: Bearer " + secret_ + "\r\n"), "401") << "a token only reads";
  EXPECT_EQ(post_as(json + length + ours + cookie(guest)), "403");
  EXPECT_EQ(status(ask("GET", "takes/1", cookie(guest))), "403");
  EXPECT_EQ(status(ask("GET", "api/state", cookie(guest))), "200");
  EXPECT_EQ(post_as(json + length + cookie(secret_)), "403") << "no Origin";
  EXPECT_EQ(post_as(json + length + "Origin: https://evil.example\r\n" + cookie(secret_)), "403");
  EXPECT_EQ(post_as(json + length + "Origin: http://rig.test\r\n" + cookie(secret_)), "403");
  EXPECT_EQ(post_as(json + length + "Origin: null\r\n" + cookie(secret_)), "403");
  EXPECT_EQ(post_as("Content-Type: application/x-www-form-urlencoded\r\n" + length + ours + cookie(secret_)), "415");
  EXPECT_EQ(post_as("Content-Type: text/plain\r\n" + length + ours + cookie(secret_)), "415");
  EXPECT_EQ(status(get("api/record")), "404") << "GET changes nothing";
  EXPECT_EQ(status(ask("GET", "api/state", "Origin: https://evil.example\r\n" + cookie(secret_))), "403");
  for (const std::string method : {"PUT", "DELETE", "OPTIONS", "TRACE", "PATCH"})
    EXPECT_EQ(status(ask(method, "api/record", cookie(secret_))), "405") << method;
  for (const std::string name :
       {"takes/1/../../../etc/passwd", "takes/1/%2e%2e%2fstate", "..%2f..%2fetc/passwd", "takes/1/..", "takes/-1",
        "takes/1/", "takes/99999999999999999999", "takes/1/cam0-0000.mkv.", "vendor/../rig.html", "//etc/passwd",
        "main.js", "heads.html", "api/take_delete"}) {
    const std::string answer = get(name);
    EXPECT_EQ(status(answer), "404") << name << "\n" << answer;
  }
  EXPECT_EQ(answer_to_host("evil.example"), "421") << "DNS rebinding";
  EXPECT_EQ(answer_to_host("127.0.0.1"), "421");
  EXPECT_EQ(answer_to_host("RIG.test:8443"), "200");
  EXPECT_EQ(answer_to_host("rig.test:84a3"), "421");
  EXPECT_EQ(answer_to_host("192.168.8.1\r\nX-Server-Addr: 192.168.8.1"), "200") << "the literal that it is reached by";
  EXPECT_EQ(answer_to_host("192.168.8.2\r\nX-Server-Addr: 192.168.8.1"), "421");
  EXPECT_EQ(answer_to_host("[fe80::1]:443\r\nX-Server-Addr: fe80::1"), "200");
  EXPECT_EQ(state()["status"]["recording"]["take"], Json()) << "nothing of all this began a take";

  ASSERT_EQ(nodal_web({"revoke", "3"}).code, 0);
  EXPECT_EQ(status(get("api/state")), "401") << "a revoked device";
  EXPECT_EQ(nodal_web({"revoke", "3"}).code, 1);
  const Finished devices = nodal_web({"devices"});
  EXPECT_NE(devices.out.find("guest"), std::string::npos);
  EXPECT_EQ(devices.out.find("phone"), std::string::npos);
  const std::string last = code();
  for (int k = 0; k < 5; ++k) EXPECT_EQ(pair_with(std::string(32, 'e')), "404");
  EXPECT_EQ(pair_with(last), "404") << "five wrong ones end it";
}

TEST_F(WebTest, AmbiguousAndMalformedRequests_AreAnsweredWith400OrNotAtAll) {
  start_nodald();
  start_web();
  secret_ = paired("phone");
  const std::string body = R"({"on": true})";
  const std::string start = "POST /api/genlock HTTP/1.1\r\nHost: rig.test\r\nOrigin: https://rig.test\r\n" +
                            cookie(secret_) + "Content-Type: application/json\r\n";
  const std::string chunks = "c\r\n" + body + "\r\n0\r\n\r\n", twelve = "Content-Length: 12\r\n";
  const std::vector<std::string> requests{
      start + twelve + "Transfer-Encoding: chunked\r\n\r\n" + chunks,
      start + "Transfer-Encoding: chunked\r\n" + twelve + "\r\n" + chunks,
      start + "Transfer-Encoding: chunked\r\n\r\n" + chunks,
      start + "Transfer-Encoding: gzip\r\n" + twelve + "\r\n" + body,
      start + "Transfer-Encoding: xchunked\r\n" + twelve + "\r\n" + body,
      start + twelve + "Content-Length: 5\r\n\r\n" + body,
      start + twelve + twelve + "\r\n" + body,
      start + "Content-Length : 12\r\n\r\n" + body,
      start + "Content-Length: +12\r\n\r\n" + body,
      start + "Content-Length: -1\r\n\r\n" + body,
      start + "\r\n" + body,
      start + "Transfer-Encoding: chunked\r\n\r\n-2\r\n" + body + "\r\n0\r\n\r\n",
      "GET /pair HTTP/1.1\r\n\r\n",
      "GET /pair HTTP/1.1\r\nHost: rig.test\r\nHost: rig.test\r\n\r\n",
      // libmicrohttpd joins folded lines before anybody sees them; the joined Host is another one.
      "GET /pair HTTP/1.1\r\nHost: rig.test\r\n .evil.example\r\n\r\n",
      // A zero byte in a value is not here: libmicrohttpd shows the value up to it, which changes no framing.
      "GET /pair HTTP/1.1\r\nHost: rig.test\r\nX-A: " + std::string(40 << 10, 'a') + "\r\n\r\n",
  };
  ASSERT_EQ(requests.size(), 16u);
  for (std::size_t k = 0; k < requests.size(); ++k) {
    const std::string answer = send(requests[k], 1);
    if (answer.empty()) continue;
    EXPECT_EQ(answer.substr(9, 1), "4") << k << ": " << answer.substr(0, 300);
    EXPECT_EQ(answer.find("HTTP/1.1 2"), std::string::npos) << k << ": " << answer;
  }
  EXPECT_EQ(nodal_json({"genlock", "show"}).at(0)["state"], "off");
  EXPECT_EQ(status(post("api/genlock", body, secret_)), "200") << "the same request in order";
}

/// Connections that send some bytes of a request and then nothing.
class Held {
 public:
  Held(const WebTest& web, std::size_t count, const std::string& bytes) {
    for (std::size_t k = 0; k < count; ++k) {
      sockets_.push_back(web.connected());
      (void)!::send(sockets_.back(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
    }
  }
  ~Held() {
    for (const int each : sockets_) ::close(each);
  }
  Held(const Held&) = delete;
  Held& operator=(const Held&) = delete;
  /// How many the server has closed.
  std::size_t closed() const {
    return static_cast<std::size_t>(std::ranges::count_if(sockets_, [](int each) {
      char byte = 0;
      ssize_t got = 1;
      while ((got = ::recv(each, &byte, 1, MSG_DONTWAIT)) == 1) {}  // an answer that says why
      return got == 0 || (errno != EAGAIN && errno != EWOULDBLOCK);
    }));
  }

 private:
  std::vector<int> sockets_;
};

TEST_F(WebTest, HundredsOfHeldConnections_KeepNoPairedPhoneOutAndAreClosed) {
  start_nodald();
  bring_up();
  start_web();
  secret_ = paired("phone");
  const std::string start = "POST /api/pair HTTP/1.1\r\nHost: rig.test\r\n";
  const Held silent(*this, 100, ""), headers(*this, 100, start + "X-A: a"),
      bodies(*this, 100,
             start + "Origin: https://rig.test\r\nContent-Type: application/json\r\nContent-Length: 500\r\n\r\n{");
  for (int k = 0; k < 5; ++k) {
    EXPECT_EQ(status(get("api/state")), "200");
    EXPECT_TRUE(body_of(get("live?after=0")).starts_with("\xFF\xD8\xFF"));
  }
  EXPECT_TRUE(wait_until([&] { return silent.closed() + headers.closed() + bodies.closed() == 300; }))
      << "in ten seconds";
}

}  // namespace
}  // namespace nodal::command_line
