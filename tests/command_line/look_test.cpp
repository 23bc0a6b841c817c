// `nodal look` as a user starts it, without a browser.
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <fstream>

#include "page_request.h"
#include "tests/support/pictures.h"
#include "tests/support/process.h"

namespace nodal::command_line {
namespace {

using test::Finished;
using test::Process;

class Look : public testing::Test {
 protected:
  Look() { test::write_bytes(folder_ / "sphere.png", test::png_of(test::smooth_rgb(256, 128), 256, 128, 3)); }
  /// The words of a command that shows the picture.
  std::vector<std::string> words(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> all{NODAL_BIN_DIR "/nodal", "look", (folder_ / "sphere.png").string()};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
  /// "http://127.0.0.1:PORT/TOKEN/", once it is printed.
  static std::string link_of(Process& look) {
    EXPECT_TRUE(test::wait_until([&] { return look.said().find("/\n") != std::string::npos; })) << look.complained();
    return look.said().substr(0, look.said().find('\n'));
  }

  test::TemporaryFolder folder_;
};

TEST_F(Look, ALinkIsPrinted_ItServesThePageAndTheRaymap_AndCtrlCIsItsEnd) {
  Process look(words({"--from", "equirectangular"}));
  const std::string link = link_of(look);
  const std::string begin = "http://127.0.0.1:";
  ASSERT_TRUE(link.starts_with(begin)) << link;
  const int port = std::stoi(link.substr(begin.size()));
  const std::string path = link.substr(link.find('/', begin.size()));
  EXPECT_NE(get(port, path).find("<!doctype html>"), std::string::npos);
  EXPECT_NE(get(port, path + "scene.json").find("\"layout\":\"equirectangular\""), std::string::npos);
  EXPECT_NE(get(port, path + "mesh.glb?envelope=1").find("model/gltf-binary"), std::string::npos);
  EXPECT_EQ(get(port, "/scene.json"), "") << "without the token";
  look.signal(SIGINT);
  EXPECT_EQ(look.wait().code, 0);
  EXPECT_EQ(get(port, path), "");
}

TEST_F(Look, Open_StartsTheBrowserWithTheLink) {
  std::ofstream(folder_ / "xdg-open") << "#!/bin/sh\nprintf %s \"$1\" >" << (folder_ / "asked.part").string() << "\nmv "
                                      << (folder_ / "asked.part").string() << " " << (folder_ / "asked").string()
                                      << "\n";
  std::filesystem::permissions(folder_ / "xdg-open", std::filesystem::perms::owner_all);
  Process look(words({"--from", "equirectangular", "--open"}), {{"PATH", folder_.path().string() + ":/usr/bin:/bin"}});
  const std::string link = link_of(look);
  EXPECT_TRUE(test::wait_until([&] { return std::filesystem::exists(folder_ / "asked"); }));
  const std::vector<std::uint8_t> asked = test::read_bytes(folder_ / "asked");
  EXPECT_EQ(std::string(asked.begin(), asked.end()), link);
  look.signal(SIGTERM);
  EXPECT_EQ(look.wait().code, 0);
}

TEST_F(Look, WhatIsNoRaymap_IsRefusedInASentenceAndNothingIsServed) {
  const Finished unsaid = Process(words()).wait();
  EXPECT_EQ(unsaid.out, "");
  EXPECT_NE(unsaid.err.find("say its layout: --from"), std::string::npos) << unsaid.err;
  const Finished gone = Process({NODAL_BIN_DIR "/nodal", "look", (folder_ / "gone.png").string()}).wait();
  EXPECT_NE(gone.code, 0);
  EXPECT_NE(gone.err.find("gone.png"), std::string::npos) << gone.err;
  std::ofstream(folder_ / "hole.obj") << "v 0 0 1\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  const Finished hole =
      Process(words({"--from", "equirectangular", "--envelope", (folder_ / "hole.obj").string()})).wait();
  EXPECT_NE(hole.code, 0);
  EXPECT_NE(hole.err.find("hole.obj"), std::string::npos) << hole.err;
}

}  // namespace
}  // namespace nodal::command_line
