#include "page_driver.h"

#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <numbers>
#include <sstream>

namespace nodal::command_line {
namespace fs = std::filesystem;
using test::Finished;
using test::Process;

namespace {

constexpr std::chrono::seconds kLongestScript{500};

}  // namespace

bool PageDriver::in_firefox() {
  const char* const wanted = std::getenv("NODAL_BROWSER");
  return wanted != nullptr && std::string(wanted) == "firefox";
}

bool PageDriver::browser_is_here() {
  const fs::path modules = fs::path(NODAL_SOURCE_DIR) / "build/browser/node_modules";
  return fs::exists(modules / "puppeteer-core") && fs::exists(modules / "axe-core") && fs::exists(modules / "iwer") &&
         std::system(in_firefox() ? "command -v firefox-esr >/dev/null && command -v Xvfb >/dev/null"
                                  : "command -v chromium >/dev/null && command -v node >/dev/null") == 0;
}

void PageDriver::SetUp() {
  if (!browser_is_here()) GTEST_SKIP() << "the browser or puppeteer-core is not here; tests/browser/fetch gets them";
}

Finished PageDriver::nodal(Words words) {
  words.insert(words.begin(), NODAL_BIN_DIR "/nodal");
  return Process(words).wait();
}

void PageDriver::write_sphere(const std::string& name, int width) const {
  std::vector<std::uint8_t> rgb;
  for (int y = 0; y < width / 2; ++y) {
    for (int x = 0; x < width; ++x) {
      const double theta = 2 * std::numbers::pi * (x + 0.5) / width, phi = 2 * std::numbers::pi * (y + 0.5) / width;
      for (const double k : {3.0, 7.0, 22.0}) {
        const double wave = std::sin(phi) * std::sin(phi) * std::sin(k * theta + k) * std::cos(k * phi / 2);
        rgb.push_back(static_cast<std::uint8_t>(std::lround(140 + 100 * wave)));
      }
    }
  }
  test::write_bytes(path(name), test::png_of(rgb, width, width / 2, 3));
}

std::vector<PageDriver::Json> PageDriver::drive(Words words, const Json& steps) const {
  words.insert(words.begin(), {NODAL_BIN_DIR "/nodal", "look"});
  Process look(words);
  EXPECT_TRUE(test::wait_until([&] { return look.said().find("/\n") != std::string::npos; })) << look.complained();
  std::string link = look.said();
  link.resize(std::min(link.size(), link.find('\n')));
  std::vector<Json> printed = run_script({"look_page.mjs", link, folder_.path().string(), steps.dump()});
  look.signal(SIGINT);
  EXPECT_EQ(look.wait().code, 0) << "Ctrl-C is its usual end";
  return printed;
}

std::vector<PageDriver::Json> PageDriver::run_script(Words words) const {
  words.front() = NODAL_SOURCE_DIR "/tests/browser/" + words.front();
  words.insert(words.begin(), "node");
  const Finished driver = Process(words).wait(kLongestScript);
  EXPECT_EQ(driver.code, 0) << driver.err;
  std::vector<Json> printed;
  std::istringstream lines(driver.out);
  for (std::string line; std::getline(lines, line);) printed.push_back(Json::parse(line));
  keep_shots();
  return printed;
}

void PageDriver::keep_shots() const {
  const char* const keep = std::getenv("NODAL_KEEP_SHOTS");
  if (keep == nullptr) return;
  const std::string test = testing::UnitTest::GetInstance()->current_test_info()->name();
  for (const auto& entry : fs::directory_iterator(folder_.path())) {
    if (entry.path().extension() == ".png")
      fs::copy_file(entry.path(), fs::path(keep) / (test + "-" + entry.path().filename().string()),
                    fs::copy_options::overwrite_existing);
  }
}

}  // namespace nodal::command_line
