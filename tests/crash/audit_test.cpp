// The power fails in every single operation of the audit file, while it is made, extended and replaced.
#include <gtest/gtest.h>

#include <string>

#include "firmware/storage/audit_store.h"
#include "hal/sim/disk.h"

namespace nodal::crash {
namespace {

using firmware::AuditReport;
using firmware::AuditStore;
using hal::sim::SimDisk;

/// Reads the log of a disk.
AuditReport log_of(SimDisk& disk) {
  AuditStore store(disk);
  store.step({});
  return store.snapshot().read();
}

/// Writes records until `last`; returns the number of the newest that was answered.
std::uint64_t write_until(SimDisk& disk, std::uint64_t last, std::size_t text_bytes) {
  AuditStore store(disk);
  store.step({});
  std::uint64_t answered = store.snapshot().read().newest;
  for (std::uint64_t n = answered + 1; n <= last; ++n) {
    EXPECT_TRUE(store.writes().push({n, std::to_string(n) + std::string(text_bytes, 'x')}));
    store.step({});
    const auto written = store.answers().pop();
    if (!written || !written->status) break;
    answered = written->number;
  }
  return answered;
}

/// The chain is whole up to what was answered. What came after it may be there, complete, or not.
void expect_whole(SimDisk& disk, std::uint64_t answered, const std::string& when) {
  const AuditReport report = log_of(disk);
  EXPECT_GE(report.newest, answered) << when;
  EXPECT_LE(report.newest, answered + 1) << when;
  for (const std::string& finding : report.findings) {
    EXPECT_NE(finding.find("incomplete record"), std::string::npos) << when << ": " << finding;
  }
  std::uint64_t number = report.records->empty() ? 0 : report.records->front().number - 1;
  for (const firmware::AuditRecord& record : *report.records) {
    EXPECT_EQ(record.number, ++number) << when;
    EXPECT_EQ(record.text.find(std::to_string(number) + "x"), 0u) << when;
  }
  EXPECT_EQ(number, report.newest) << when;
  // It goes on.
  EXPECT_EQ(write_until(disk, report.newest + 2, 3), report.newest + 2) << when;
  EXPECT_TRUE(log_of(disk).findings.empty()) << when;
}

void cut_everywhere(std::uint64_t before, std::uint64_t last, std::size_t text_bytes, int seeds) {
  std::uint64_t begin = 0;
  std::uint64_t end = 0;
  {
    SimDisk disk;
    write_until(disk, before, text_bytes);
    begin = disk.operations();
    ASSERT_EQ(write_until(disk, last, text_bytes), last);
    end = disk.operations();
  }
  ASSERT_GT(end, begin);
  for (std::uint64_t k = begin; k < end; ++k) {
    SimDisk disk;
    write_until(disk, before, text_bytes);
    disk.die_at(k);
    const std::uint64_t answered = write_until(disk, last, text_bytes);
    ASSERT_TRUE(disk.dead());
    for (int seed = 0; seed < seeds; ++seed) {
      const auto after = disk.after_power_loss(static_cast<std::uint64_t>(seed));
      expect_whole(*after, answered, "cut in operation " + std::to_string(k) + ", seed " + std::to_string(seed));
    }
  }
}

TEST(AuditFile, ThePowerFailsWhileItIsMadeAndExtended_TheChainIsWholeUpToWhatWasAnswered) {
  cut_everywhere(0, 5, 30, 30);
}

TEST(AuditFile, ThePowerFailsWhileItIsReplaced_TheChainIsWholeUpToWhatWasAnswered) {
  constexpr std::size_t kText = 60'000;  // eight fill a file
  cut_everywhere(7, 10, kText, 10);
  cut_everywhere(15, 19, kText, 10);
}

}  // namespace
}  // namespace nodal::crash
