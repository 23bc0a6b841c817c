// `nodal look` at a running rig and at its takes, without a browser.
#include <csignal>

#include "page_request.h"
#include "rig_process.h"

namespace nodal::command_line {
namespace {

class LookRig : public RigTest {
 protected:
  /// The number after a header's name; -1: there is no such header.
  static long header(const std::string& answer, const std::string& name) {
    const std::size_t at = answer.find(name + ": ");
    return at == std::string::npos ? -1 : std::stol(answer.substr(at + name.size() + 2));
  }
};

TEST_F(LookRig, TheNewestRaymapAndItsAgeAreServed_AndTheRigMayGoAndComeBack) {
  start_nodald();
  bring_up();
  const auto look = start({"look"});
  const PageLink link = PageLink::of(*look);
  const Json scene = Json::parse(link.body("scene.json"));
  EXPECT_EQ(scene["live"], true);
  EXPECT_EQ(scene["layout"], "equirectangular");
  EXPECT_EQ(scene["picture_width"], 256);
  const std::string first = link.answer("live?after=0");
  ASSERT_NE(first.find(" 200 "), std::string::npos) << first.substr(0, 400);
  EXPECT_NE(first.find("\xFF\xD8\xFF"), std::string::npos) << "a JPEG";
  EXPECT_NE(first.find("X-Age-Of: mid-exposure"), std::string::npos);
  EXPECT_GE(header(first, "X-Age-Ms"), 0);
  EXPECT_LT(header(first, "X-Age-Ms"), 5000);
  const long number = header(first, "X-Number"), set = header(first, "X-Set");
  ASSERT_TRUE(wait_until([&] { return header(link.answer("live?after=" + std::to_string(number)), "X-Set") > set; }));
  EXPECT_NE(link.answer("live?after=1e15").find(" 204 "), std::string::npos);
  EXPECT_NE(link.answer("live").find(" 400 "), std::string::npos);

  nodald().signal(SIGKILL);
  nodald().wait();
  ASSERT_TRUE(wait_until([&] { return link.answer("live?after=1e15").find("X-Problem: ") != std::string::npos; }));
  const long last = header(link.answer("live?after=0"), "X-Number");
  EXPECT_GT(last, 0) << "the last picture stays";
  start_nodald();
  ASSERT_EQ(nodal({"genlock", "start"}).code, 0);
  EXPECT_TRUE(wait_until([&] { return header(link.answer("live?after=" + std::to_string(last)), "X-Number") > last; }))
      << "it comes back by itself";
  look->signal(SIGINT);
  EXPECT_EQ(look->wait().code, 0);
}

TEST_F(LookRig, WithoutARig_TheReasonIsSaid) {
  const Finished none = nodal({"--rig", "unix:" + path("nowhere.sock"), "--timeout", "1s", "look"});
  EXPECT_NE(none.code, 0);
  EXPECT_NE(none.err.find("nowhere.sock"), std::string::npos) << none.err;
}

TEST_F(LookRig, ATake_IsShownRaymapByRaymap_AsItsFilmIs) {
  start_rig_with_takes();
  ASSERT_EQ(nodal({"take", "start"}).code, 0);
  ASSERT_EQ(nodal({"raymap", "pull", "-n", "12", "--out", path("live-%02d.jpg")}).code, 0);
  ASSERT_EQ(nodal({"take", "stop"}).code, 0);
  ASSERT_EQ(nodal({"take", "export", path("takes/000001"), "--to", path("films")}).code, 0);
  const auto take = start({"look", path("takes/000001")}), film = start({"look", path("films/raymaps.mkv")});
  const PageLink of_take = PageLink::of(*take), of_film = PageLink::of(*film);
  const Json scene = Json::parse(of_take.body("scene.json"));
  const int pictures = scene["pictures"];
  ASSERT_GE(pictures, 10);
  EXPECT_EQ(Json::parse(of_film.body("scene.json"))["pictures"], pictures);
  EXPECT_EQ(Json::parse(of_take.body("times.json")).size(), static_cast<std::size_t>(pictures - 1));
  for (const int k : {0, pictures - 1, pictures / 2}) {
    const std::string name = "frame?k=" + std::to_string(k), jpeg = of_take.body(name);
    EXPECT_TRUE(jpeg.starts_with("\xFF\xD8")) << k;
    EXPECT_TRUE(jpeg == of_film.body(name)) << k;
  }
}

TEST_F(LookRig, TheRigsPage_IsServedHereWithTheUsersRightsAndForWhoeverHasTheLink) {
  start_rig_with_takes();
  fake_ssh("exec BRIDGE\n");
  const auto web = start({"--rig", "ssh://rig.test", "web"});
  const PageLink link = PageLink::of(*web);
  EXPECT_NE(link.body("").find("rig.js"), std::string::npos);
  EXPECT_EQ(Json::parse(link.body("api/me"))["rights"], "operate");
  EXPECT_EQ(Json::parse(link.body("api/state"))["status"]["rig"], "six");
  EXPECT_TRUE(link.body("live?after=0").starts_with("\xFF\xD8\xFF"));
  EXPECT_NE(link.answer("pair").find(" 404 "), std::string::npos) << "there is nothing to pair";
  EXPECT_EQ(get(link.port, "/api/state"), "") << "without the secret";
  EXPECT_NE(link.post("api/record", R"({"on": true})", "").find(" 403 "), std::string::npos) << "no page of ours";
  EXPECT_NE(link.post("api/record", R"({"on": true})", "http://evil.example").find(" 403 "), std::string::npos);
  EXPECT_NE(link.post("api/record", R"({"on": true})").find(R"("take":1)"), std::string::npos);
  EXPECT_NE(link.post("api/record", R"({"on": false})").find(" 200 "), std::string::npos);
  const std::string film = link.body("takes/1/cam0-0000.mkv");
  EXPECT_TRUE(!film.empty() && film == read("takes/000001/cam0-0000.mkv"));
  EXPECT_NE(nodal_json({"audit"}).at(0).dump().find("for \\\"This computer\\\""), std::string::npos);

  const auto watching = start({"web", "--watch"});
  const PageLink watched = PageLink::of(*watching);
  EXPECT_EQ(Json::parse(watched.body("api/me"))["rights"], "watch");
  EXPECT_NE(watched.post("api/record", R"({"on": true})").find(" 403 "), std::string::npos);
  EXPECT_NE(watched.answer("takes/1").find(" 403 "), std::string::npos);
  for (Process* each : {web.get(), watching.get()}) {
    each->signal(SIGINT);
    EXPECT_EQ(each->wait().code, 0);
  }
}

TEST_F(LookRig, WithoutARigThePageOfOne_IsNotServed) {
  const Finished none = nodal({"--rig", "unix:" + path("nowhere.sock"), "--timeout", "1s", "web"});
  EXPECT_NE(none.code, 0);
  EXPECT_NE(none.err.find("nowhere.sock"), std::string::npos) << none.err;
}

}  // namespace
}  // namespace nodal::command_line
