// `nodal look --heads` at a running rig and at its takes, without a browser: every step is a request to the program.
#include <csignal>

#include "bumped_rig.h"
#include "page_request.h"
#include "stitch/media/image_file.h"

namespace nodal::command_line {
namespace {

class LookHeads : public BumpedRig {
 protected:
  void begin(Words words) {
    words.insert(words.begin(), {"look", "--heads", "-o", path("placed.json")});
    look_ = start(std::move(words));
    link_ = PageLink::of(*look_);
  }
  void end() {
    look_->signal(SIGINT);
    EXPECT_EQ(look_->wait().code, 0) << look_->complained();
  }
  Json state() {
    (void)nodald().complained();
    return Json::parse(link_.body("state.json"));
  }
  /// The status and the text of the answer to a change.
  std::string change(Json words) {
    words["revision"] = state()["revision"];
    const std::string answer = link_.post("change", words.dump());
    return answer.substr(answer.find(' ') + 1);
  }
  /// Until the trial is in a phase, or has ended otherwise.
  Json trial(const std::string& phase) {
    Json now;
    EXPECT_TRUE(wait_until([&] {
      now = state()["trial"];
      return now["phase"] == phase || now["under_way"] == false;
    })) << now;
    EXPECT_EQ(now["phase"], phase) << now;
    return now;
  }
  Json registered() {
    Json now;
    EXPECT_TRUE(wait_until([&] { return (now = state())["registering"].is_null(); }));
    EXPECT_EQ(now["registered"]["error"], "") << now;
    return now;
  }
  DecodedImage head_picture(const std::string& query) {
    const std::string jpeg = link_.body("head?side=4096&" + query);
    const std::vector<std::uint8_t> bytes(jpeg.begin(), jpeg.end());
    return media::decode_image(bytes, query, PixelFormat::kRgb24).value();
  }

  std::unique_ptr<Process> look_;
  PageLink link_;
};

TEST_F(LookHeads, OfARunningRig_AreRegisteredTriedAndKept_OrDropped) {
  film();
  begin({});
  EXPECT_FALSE(Json::parse(link_.body("scene.json"))["rig"].is_null());
  EXPECT_TRUE(state()["trial"].is_null());
  ASSERT_TRUE(change({{"do", "register"}, {"free", "rotations"}}).starts_with("200"));
  const Json heads = registered()["heads"];
  EXPECT_NEAR(heads[kBumped]["turned_deg"].get<double>(), kBumpDeg, 0.03);
  EXPECT_LT(heads[0]["turned_deg"].get<double>(), 0.03) << "heads that stand stay";

  ASSERT_TRUE(change({{"do", "try"}}).starts_with("200"));
  const Json better = trial("on trial");
  EXPECT_TRUE(better["says"].get<std::string>().starts_with("It is better: ")) << better;
  EXPECT_GT(better["left_s"].get<double>(), 60) << better;
  EXPECT_TRUE(on_trial()) << "the rig says so, too";
  EXPECT_TRUE(change({{"do", "try"}}).starts_with("409")) << "one at a time";
  ASSERT_TRUE(change({{"do", "keep"}}).starts_with("200"));
  trial("kept");
  ASSERT_TRUE(change({{"do", "save"}}).starts_with("200"));
  const std::string kept = id_of(parse_calibration(read("placed.json")).value());
  EXPECT_EQ(in_force(), kept);
  EXPECT_FALSE(on_trial());
  EXPECT_TRUE(change({{"do", "drop"}}).starts_with("409")) << "nothing is on trial";

  ASSERT_TRUE(change({{"do", "turn"}, {"heads", {1}}, {"about", {0, 0.02, 0}}}).starts_with("200"));
  ASSERT_TRUE(change({{"do", "try"}}).starts_with("200"));
  const Json worse = trial("on trial");
  EXPECT_TRUE(worse["says"].get<std::string>().starts_with("It is not better: ")) << worse;
  EXPECT_NE(in_force(), kept);
  ASSERT_TRUE(change({{"do", "drop"}}).starts_with("200"));
  trial("dropped");
  EXPECT_EQ(in_force(), kept);
  EXPECT_EQ(nodal_json({"calibration", "list"}).at(0)["calibrations"].size(), 2u) << "what was dropped is not stored";
  end();
}

TEST_F(LookHeads, TheProgramEndsDuringATrial_TheRigGoesBack) {
  film();
  begin({});
  ASSERT_TRUE(change({{"do", "turn"}, {"heads", {1}}, {"about", {0, 0.02, 0}}}).starts_with("200"));
  ASSERT_TRUE(change({{"do", "try"}}).starts_with("200"));
  trial("on trial");
  look_->signal(SIGINT);
  look_->wait();
  EXPECT_TRUE(wait_until([&] { return !on_trial(); })) << "at once, not after the trial's limit";
  EXPECT_EQ(in_force(), id_of(six("six")));
}

TEST_F(LookHeads, TheRigGoesAwayDuringATrial_TheReasonIsSaidAndThePageStays) {
  film();
  begin({});
  ASSERT_TRUE(change({{"do", "turn"}, {"heads", {1}}, {"about", {0, 0.02, 0}}}).starts_with("200"));
  ASSERT_TRUE(change({{"do", "try"}}).starts_with("200"));
  trial("on trial");
  nodald().signal(SIGKILL);
  nodald().wait();
  ASSERT_TRUE(change({{"do", "keep"}}).starts_with("200"));
  const Json failed = trial("failed");
  EXPECT_NE(failed["says"].get<std::string>().find("nodal.sock"), std::string::npos) << failed;
  EXPECT_NE(failed["says"].get<std::string>().find("nodal calibration list"), std::string::npos) << failed;
  EXPECT_TRUE(change({{"do", "undo"}}).starts_with("200")) << "the heads can still be placed";
  start_nodald();
  EXPECT_TRUE(wait_until([&] { return in_force() == id_of(six("six")); }));
  ASSERT_TRUE(change({{"do", "turn"}, {"heads", {1}}, {"about", {0, 0.02, 0}}}).starts_with("200"));
  ASSERT_TRUE(change({{"do", "try"}}).starts_with("200")) << "once it is back, another trial may begin";
  trial("on trial");
  ASSERT_TRUE(change({{"do", "drop"}}).starts_with("200"));
  trial("dropped");
  end();
}

TEST_F(LookHeads, ACalibrationOfAnotherRig_IsRefusedByTheRigAndSaid) {
  film();
  begin({});
  Calibration other = six("other");
  other.heads.resize(2);
  for (HeadCalibration& head : other.heads) head.name += "b";
  const std::string file = write("other.json", to_json(other));
  Words words{"--rig", environment_["NODAL_RIG"], "look", file};
  for (const int head : {0, 1}) {
    const std::string jpeg = link_.body("head?side=4096&head=" + std::to_string(head));
    words.push_back(write("other" + std::to_string(head) + ".jpg", jpeg));
  }
  end();
  look_ = start(words);
  link_ = PageLink::of(*look_);
  ASSERT_TRUE(change({{"do", "try"}}).starts_with("200"));
  const Json failed = trial("failed");
  EXPECT_NE(failed["says"].get<std::string>().find("head"), std::string::npos) << failed;
  EXPECT_EQ(in_force(), id_of(six("six")));
  end();
}

TEST_F(LookHeads, WithoutARig_NothingCanBeTried) {
  film();
  begin({});
  Words words{"look", path("six.json")};
  for (int head = 0; head < 6; ++head) {
    const std::string jpeg = link_.body("head?side=4096&head=" + std::to_string(head));
    words.push_back(write("head" + std::to_string(head) + ".jpg", jpeg));
  }
  end();
  look_ = start(words);
  link_ = PageLink::of(*look_);
  EXPECT_TRUE(Json::parse(link_.body("scene.json"))["rig"].is_null());
  const std::string refused = change({{"do", "try"}});
  EXPECT_TRUE(refused.starts_with("409")) << refused;
  EXPECT_NE(refused.find("--rig"), std::string::npos) << refused;
  words[2] = write("small.jpg", link_.body("head?side=96&head=0"));  // a picture of another size
  end();
  const Finished other_size = nodal(words);
  EXPECT_NE(other_size.code, 0);
  EXPECT_NE(other_size.err.find("small.jpg: the picture has 96x96 pixels"), std::string::npos) << other_size.err;
  words.pop_back();
  const Finished one_less = nodal(words);
  EXPECT_NE(one_less.code, 0);
  EXPECT_NE(one_less.err.find("5 pictures for 6 heads"), std::string::npos) << one_less.err;
}

TEST_F(LookHeads, OfATake_AreShownSetBySet_AndRegistered) {
  std::string toml = read("rig.toml");
  toml.insert(toml.find("[sim]\n") + 6, "scene = \"bar\"\n");  // each set shows another picture
  toml.insert(toml.find("[sim]\n"), "[takes]\nfolder = \"takes\"\nbuffer_mb = 16\n");
  write("rig.toml", toml);
  film();
  ASSERT_EQ(nodal({"take", "start"}).code, 0);
  ASSERT_EQ(nodal({"raymap", "pull", "-n", "12", "--out", path("live-%02d.jpg")}).code, 0);
  ASSERT_EQ(nodal({"take", "stop"}).code, 0);
  ASSERT_EQ(nodal({"take", "export", path("takes/000001"), "--to", path("films")}).code, 0);
  begin({path("takes/000001")});
  const Json scene = Json::parse(link_.body("scene.json"));
  const int sets = scene["pictures"];
  ASSERT_GE(sets, 10);
  EXPECT_EQ(scene["heads"].size(), 6u);
  EXPECT_EQ(Json::parse(link_.body("times.json")).size(), static_cast<std::size_t>(sets - 1));
  // The same pictures as in the exported film of the head, in any order, as ffmpeg reads them.
  for (const int set : {sets - 1, 0, sets / 2, sets / 2 - 1}) {
    const std::string query = "head=2&set=" + std::to_string(set);
    const DecodedImage shown = head_picture(query);
    ASSERT_EQ(Process({"ffmpeg", "-v", "error", "-y", "-i", path("films/cam2.mkv"), "-vf",
                       "select=eq(n\\," + std::to_string(set) + ")", "-frames:v", "1", path("frame.png")})
                  .wait()
                  .code,
              0);
    const DecodedImage frame = media::read_image(path("frame.png"), PixelFormat::kRgb24).value();
    ASSERT_EQ(shown.bytes.size(), frame.bytes.size());
    double sum = 0;
    for (std::size_t k = 0; k < frame.bytes.size(); ++k) sum += std::abs(shown.bytes[k] - frame.bytes[k]);
    EXPECT_LT(sum / static_cast<double>(frame.bytes.size()), 2) << set;
  }
  for (const std::string& set : {std::string("-1"), std::to_string(sets), std::string("x")})
    EXPECT_NE(link_.answer("head?side=4096&head=0&set=" + set).find(" 400 "), std::string::npos) << set;
  EXPECT_TRUE(change({{"do", "register"}, {"set", sets}}).starts_with("400"));
  EXPECT_TRUE(change({{"do", "turn"}, {"heads", {1}}, {"about", {0, 0.02, 0}}}).starts_with("200"));
  ASSERT_TRUE(change({{"do", "save"}}).starts_with("200"));
  EXPECT_EQ(parse_calibration(read("placed.json")).value().heads.size(), 6u) << "the take has the calibration";
  end();
  const Finished none = nodal({"look", "--heads", path("live-00.jpg")});
  EXPECT_NE(none.code, 0);
  EXPECT_NE(none.err.find("is no take"), std::string::npos) << none.err;
}

}  // namespace
}  // namespace nodal::command_line
