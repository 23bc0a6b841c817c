// nodald filming a reference rig whose heads repeat one picture each.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "tests/bench/workloads.h"
#include "tests/support/pictures.h"
#include "tests/support/process.h"

namespace nodal::bench {

/// Writes what nodald needs into a temporary folder. Throws what goes wrong.
class ReplayedRig {
 public:
  /// Heads deliver `format`: kI420, or kMjpeg, whose JPEGs have quality 85 and chroma of 4:2:0, or of 4:2:2 with
  /// `all_chroma_rows`.
  ReplayedRig(const Workload& work, PixelFormat format, bool all_chroma_rows = false, const std::string& rate = "25");

  /// Starts nodald with two threads for the blend, and waits until it answers.
  std::unique_ptr<test::Process> start();
  /// Uploads the rig's calibration under a name.
  void upload(const std::string& name);
  /// Runs nodal with this rig; returns its output.
  std::string nodal(std::vector<std::string> words);

  const std::filesystem::path& folder() const { return folder_.path(); }
  /// Of one picture of each head, as nodald keeps it.
  std::size_t picture_bytes() const { return picture_bytes_; }

 private:
  void write(const std::string& name, const std::string& text);
  std::vector<std::string> command(std::vector<std::string> words) const;

  const Workload work_;
  test::TemporaryFolder folder_;
  std::size_t picture_bytes_ = 0;
};

}  // namespace nodal::bench
