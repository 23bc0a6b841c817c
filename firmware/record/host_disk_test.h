// A test of the disk that hosts ask for. One test answers all who ask while it runs.
#pragma once

#include <cstdint>
#include <optional>

#include "firmware/config/config.h"
#include "firmware/record/disk_test.h"
#include "firmware/record/take_mailbox.h"
#include "firmware/record/take_shelf.h"
#include "firmware/record/waiting_tickets.h"
#include "hal/disk.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// Threading: thread-bound to the takes' stage; a step blocks on the disk.
/// Ownership: all that it is made with outlives it.
/// Errors: in the answers.
class HostDiskTest {
 public:
  /// `buffer`: bytes of the recorder's memory, for the verdicts.
  HostDiskTest(const RigConfig& config, hal::DiskPort& disk, TakeShelf& shelf, TakeMailbox& mail, std::size_t buffer)
      : config_(config), disk_(disk), shelf_(shelf), mail_(mail), buffer_(buffer) {}

  bool running() const { return test_.has_value(); }
  std::optional<std::uint32_t> percent(Instant now) const;
  /// Begins a test, or lets the request wait for the end of the one that runs.
  Status begin(const TakeRequest& request, const TakeRequest::TestDisk& what, Instant now);
  /// True when it did something.
  bool step(Instant now);
  /// Ends a test that runs. Its file is removed before the answers go.
  void end(const Result<TakeMailbox::Answered>& result);

 private:
  TakeAnswer::DiskTested judged(const DiskSpeed& speed) const;

  const RigConfig& config_;
  hal::DiskPort& disk_;
  TakeShelf& shelf_;
  TakeMailbox& mail_;
  const std::size_t buffer_;
  struct Test {
    WaitingTickets tickets;  ///< tickets of all requests that wait for the test's result
    TakeShelf::Hold held;
    HeadShapes heads;
    FrameRate rate;
    std::unique_ptr<DiskTest> test;
  };
  std::optional<Test> test_;
};

}  // namespace nodal::firmware
