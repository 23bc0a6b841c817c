// A real nodald on a small simulated rig, and the real `nodal` as its client.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "protocol/calibration.h"
#include "tests/support/process.h"

namespace nodal::command_line {

using Json = nlohmann::json;
using ::nodal::test::Finished;
using ::nodal::test::Process;
using ::nodal::test::wait_until;
using Words = std::vector<std::string>;

/// Six rectilinear heads of 100 degrees, `side` px square, that look along the axes: forward, right, back, left, up,
/// down. Every ray is seen by one to three heads. Two results of the same size differ only in `name`.
Calibration six_heads(const std::string& name, int side = 96);

/// While it lives, `nodal` refuses to write over files, as it does for users; for other tests it replaces them
/// (tests/support/process.cpp).
class Refusing {
 public:
  Refusing() { ::setenv("NODAL_OVERWRITE", "0", 1); }
  ~Refusing() { ::unsetenv("NODAL_OVERWRITE"); }
  Refusing(const Refusing&) = delete;
  Refusing& operator=(const Refusing&) = delete;
};

/// A temporary folder with rig.toml, truth.json and six.json, and a nodald that runs in it.
class RigTest : public ::testing::Test {
 protected:
  RigTest();
  ~RigTest() override;

  /// Starts or restarts nodald on the same store, and waits until it listens.
  void start_nodald();
  Process& nodald() { return *nodald_; }

  /// Runs `nodal WORDS` on this rig and waits for its end.
  Finished nodal(Words words) const;
  /// The same with --json; returns its documents, one per line.
  std::vector<Json> nodal_json(Words words) const;
  std::unique_ptr<Process> start(Words words) const;
  /// Waits until all that a take has recorded so far is on the disk for certain.
  void wait_until_durable() const;
  /// Uploads six.json, starts the genlock and waits until it is locked.
  void bring_up() const;
  /// Both, of a rig that records takes.
  void start_rig_with_takes();
  /// Writes a program for NODAL_SSH: a shell script in which BRIDGE is replaced by the bridge command.
  void fake_ssh(const std::string& script);

  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  std::string write(const std::string& name, const std::string& content) const;
  std::string read(const std::string& name) const;

  std::map<std::string, std::string> environment_;  ///< environment of nodal and nodald
  Words under_;                                     ///< words before every command, such as those of a debugger

 private:
  std::filesystem::path folder_;
  std::unique_ptr<Process> nodald_;
};

}  // namespace nodal::command_line
