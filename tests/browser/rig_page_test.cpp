// The page of a rig, by nodal-web, in headless Chromium: one browser and one rig for all that is looked at.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "page_driver.h"
#include "protocol/base/sha256.h"
#include "rig_process.h"
#include "stitch/media/image_file.h"

namespace nodal::command_line {
namespace {

namespace fs = std::filesystem;

class RigPage : public RigTest {
 protected:
  void SetUp() override {
    if (!PageDriver::browser_is_here() || std::system("command -v openssl >/dev/null") != 0)
      GTEST_SKIP() << "chromium, puppeteer-core or openssl is not here; tests/browser/fetch gets the first two";
    std::string toml = read("rig.toml");
    const std::string control = "unix = \"nodal.sock\"\n";
    toml.replace(toml.find(control), control.size(), control + "operate = \"operate.sock\"\n");
    write("rig.toml", toml);
    fs::create_directory(path("state"));
    fs::create_directory(path("shots"));
    start_rig_with_takes();
    web_ = std::make_unique<Process>(Words{NODAL_BIN_DIR "/nodal-web", "serve", "--socket", path("web.sock"), "--rig",
                                           "unix:" + path("operate.sock"), "--state", path("state")});
    ASSERT_TRUE(wait_until([&] { return fs::exists(path("web.sock")); })) << web_->complained();
    ASSERT_EQ(Process({"openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=rig", "-days", "2",
                       "-keyout", path("key.pem"), "-out", path("cert.pem")})
                  .wait()
                  .code,
              0);
  }
  std::string code(const Words& more) const {
    Words words{NODAL_BIN_DIR "/nodal-web", "pair", "--at", "https://127.0.0.1", "--state", path("state")};
    words.insert(words.end(), more.begin(), more.end());
    const std::string link = Process(words).wait().out;
    return link.substr(link.find('#') + 1, 32);
  }
  /// What the driver printed for a step; waits for it.
  Json step(const std::string& name) {
    Json found;
    EXPECT_TRUE(wait_until([&] {
      std::istringstream lines(driver_->said());
      for (std::string line; std::getline(lines, line);) {
        if (line.ends_with('}') && Json::parse(line)["step"] == name) found = Json::parse(line);
      }
      return !found.is_null();
    })) << name
        << ": " << driver_->complained();
    return found;
  }

  /// In the screenshot of the open page, below the header.
  std::size_t colours_of_the_sphere() const {
    const DecodedImage shot = media::read_image(path("shots/open.png"), PixelFormat::kRgb24).value();
    std::set<std::array<std::uint8_t, 3>> colours;
    for (int y = 100; y < 500; ++y) {
      for (int x = 200; x < shot.width; ++x) {
        const auto at = static_cast<std::size_t>(y * shot.width + x) * 3;
        colours.insert({shot.bytes[at], shot.bytes[at + 1], shot.bytes[at + 2]});
      }
    }
    return colours.size();
  }

  std::unique_ptr<Process> web_, driver_;
};

TEST_F(RigPage, RecordsDownloadsComesBackAndFitsEverybody) {
  driver_ =
      std::make_unique<Process>(Words{"node", NODAL_SOURCE_DIR "/tests/browser/rig_page.mjs", path("web.sock"),
                                      path("shots"), path("key.pem"), path("cert.pem"), code({}), code({"--watch"})});
  const Json opened = step("open"), none = Json::array();
  ASSERT_FALSE(opened.is_null());
  EXPECT_EQ(opened["code_stays"], false) << "not in the address bar";
  EXPECT_EQ(opened["name"], "six");
  EXPECT_LT(opened["age_ms"], 5000);
  EXPECT_GT(colours_of_the_sphere(), 1000u) << "it is drawn";
  EXPECT_EQ(opened["axe"], none);

  const Json recorded = step("recorded");  // RecordPressedTwice_OneTakeDownloads
  EXPECT_EQ(recorded["begun"], 1);
  EXPECT_EQ(recorded["ended"], Json());
  EXPECT_EQ(recorded["takes"], 1);
  EXPECT_EQ(recorded["axe"], none);
  const std::string film = read("takes/000001/cam0-0000.mkv");
  EXPECT_EQ(recorded["sha256"], to_hex(sha256({reinterpret_cast<const std::uint8_t*>(film.data()), film.size()})));

  const Json keys = step("keys");  // KeyboardOnly_EverythingReachable
  for (const std::string id : {"view", "turned 5", "record", "still", "program", "locked", "genlock", "summary", "a"})
    EXPECT_TRUE(std::ranges::find(keys["reached"], Json(id)) != keys["reached"].end()) << id << " " << keys;

  const Json skew = step("skew");  // SkewInjected_ChartShowsIt: 1500 us, and the limit is 500
  EXPECT_NEAR(skew["limit"].get<double>(), 40 * (1 - 500 / 1650.0), 0.02) << "of 40, from above";
  EXPECT_NEAR(skew["newest"].get<double>(), 40 * (1 - 1500 / 1650.0), 0.02);
  EXPECT_EQ(skew["bad"], true);
  EXPECT_NE(skew["words"].get<std::string>().find("Apart: 1500 µs now, at most 1500 µs"), std::string::npos) << skew;
  EXPECT_NE(skew["words"].get<std::string>().find("the limit is 500 µs"), std::string::npos) << skew;
  EXPECT_EQ(skew["unplugged"]["cells"][0], "cam2 is missing");  // HeadUnplugged_IsNamed
  EXPECT_EQ(skew["unplugged"]["bad"][0], "bad");
  EXPECT_EQ(skew["others"]["cells"][0], "cam1");
  EXPECT_EQ(skew["axe"], none);

  const Json order = step("overexpose");  // OneHeadOverexposed_ClippedShareIsTrue
  EXPECT_EQ(order["manual"], 200);
  EXPECT_EQ(order["set"], 200);
  const Json light = step("overexposed");
  for (std::size_t k = 0; k < 6; ++k) {
    const double clipped = nodal_json({"exposure", "show"}).at(0)["heads"][k]["clipped_ppm"].get<double>() / 1e4;
    const Json& cells = light["heads"][k]["cells"];
    EXPECT_NEAR(std::stod(cells[2].get<std::string>()), clipped, 1) << k << " " << cells;
    EXPECT_EQ(k == 3, clipped > 10) << k << ": " << clipped << " %";
    EXPECT_EQ(light["heads"][k]["bad"][2], clipped > 1 ? "bad" : "") << k;
  }

  const Json narrow = step("narrow");  // Width320_NothingOverflows, AxeCore_NoViolations
  EXPECT_EQ(narrow["wide"], 320);
  EXPECT_EQ(narrow["beside"], none);
  EXPECT_EQ(narrow["axe"], none);
  const Json slow = step("slow");  // SlowPhone_AgeBounded
  std::vector<double> ages = slow["ages"];
  EXPECT_GT(slow["pictures"], 3) << "fewer pictures, but some";
  const auto half = ages.begin() + static_cast<std::ptrdiff_t>(ages.size() / 2);
  std::sort(ages.begin(), half);
  std::sort(half, ages.end());
  EXPECT_LT(half[10], 4000) << "median age of later pictures, ms";
  EXPECT_LT(half[10], ages[10] + 1500) << "it does not grow";
  EXPECT_EQ(step("hidden")["requests"], 0);  // HiddenTab_RequestsNothing

  const Json watch = step("watch");  // WatchOnly_ControlsDisabled
  EXPECT_EQ(watch["enabled"], Json::array({"gyroscope", "headset"})) << "what turns the own view, and nothing else";
  EXPECT_EQ(watch["files"], 0);
  EXPECT_EQ(watch["refused"], 403);

  step("lose");  // RigRestarts_PageRecovers
  nodald().signal(SIGKILL);
  nodald().wait();
  const Json lost = step("lost");
  EXPECT_TRUE(lost["says"].get<std::string>().starts_with("The rig is gone")) << lost;
  EXPECT_EQ(lost["says"].get<std::string>().find(path("")), std::string::npos) << "no path of the rig's computer";
  EXPECT_EQ(lost["state"], "The rig does not answer.");
  EXPECT_EQ(lost["enabled"], none);
  start_nodald();
  ASSERT_EQ(nodal({"genlock", "start"}).code, 0);
  const Json back = step("back");
  EXPECT_EQ(back["says"], "");
  EXPECT_EQ(back["foreign"], none);  // NoForeignRequest
  EXPECT_EQ(back["errors"], none);
  EXPECT_EQ(driver_->wait().code, 0);
  if (const char* const keep = std::getenv("NODAL_KEEP_SHOTS")) {
    for (const auto& entry : fs::directory_iterator(path("shots")))
      fs::copy_file(entry.path(), fs::path(keep) / ("rig-" + entry.path().filename().string()),
                    fs::copy_options::overwrite_existing);
  }
}

}  // namespace
}  // namespace nodal::command_line
