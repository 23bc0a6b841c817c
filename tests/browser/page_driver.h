// Runs `nodal look` and drives its page in a browser, step by step (look_page.mjs).
#pragma once

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/pictures.h"
#include "tests/support/process.h"

namespace nodal::command_line {

class PageDriver : public testing::Test {
 public:
  static bool browser_is_here();
  /// Whether the user asks for it (NODAL_BROWSER).
  static bool in_firefox();

 protected:
  using Json = nlohmann::json;
  using Words = std::vector<std::string>;

  /// Skips where there is no Chromium.
  void SetUp() override;
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  static test::Finished nodal(Words words);
  /// An equirectangular raymap of waves that go on over its edges, with details of 8 degrees and no jump at the poles.
  void write_sphere(const std::string& name, int width) const;
  /// What the steps print, of a page that `nodal look WORDS` shows.
  std::vector<Json> drive(Words words, const Json& steps) const;
  /// What a script of this folder prints, a JSON document a line.
  std::vector<Json> run_script(Words words) const;
  /// Copies screenshots to NODAL_KEEP_SHOTS.
  void keep_shots() const;

  test::TemporaryFolder folder_;
};

}  // namespace nodal::command_line
