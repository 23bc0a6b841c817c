// The tests that every ConfinedPort must pass, and those of processes. To add an implementation: add a ConfinedWorld.
#include <gtest/gtest.h>
#include <sys/mman.h>

#include <chrono>
#include <csignal>
#include <cstring>
#include <functional>
#include <memory>
#include <new>
#include <numeric>
#include <ostream>
#include <string>
#include <thread>
#include <vector>

#include "hal/confined.h"
#include "hal/linux/confine/confine.h"
#include "hal/linux/confine/confined_process.h"
#include "hal/sim/confined.h"

namespace nodal::hal {
namespace {

using Bytes = std::vector<std::uint8_t>;
using linux_os::ConfinedLimits;
using linux_os::ConfinedProcess;

constexpr std::size_t kMax = 8 << 20;

Bytes as_bytes(const std::string& text) { return {text.begin(), text.end()}; }

/// By the job's name.
Result<Bytes> work(const ConfinedJob& job, const ConfinedProgress& progress) {
  progress();
  if (job.what == "fails") return fail(Errc::kChecksum, "file 'x': is damaged");
  if (job.what == "counts")
    return Bytes{static_cast<std::uint8_t>(std::accumulate(job.input.begin(), job.input.end(), 0))};
  if (job.what == "returns much") return Bytes(kMax, 7);
  return as_bytes(job.what);
}

struct ConfinedWorld {
  std::string name;
  std::function<std::unique_ptr<ConfinedPort>(ConfinedWork)> make;
  friend std::ostream& operator<<(std::ostream& out, const ConfinedWorld& world) { return out << world.name; }
};

Result<Bytes> result_of(ConfinedPort& port) {
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (std::chrono::steady_clock::now() < until) {
    if (auto result = port.take_result()) return *result;
    std::this_thread::yield();
  }
  return fail(Errc::kTimeout, "no result");
}

class ConfinedConformance : public testing::TestWithParam<ConfinedWorld> {
 protected:
  std::unique_ptr<ConfinedPort> port_ = GetParam().make(work);
};

TEST_P(ConfinedConformance, WorkWithInput_ReturnsItsBytesOnce) {
  ASSERT_TRUE(port_->begin({"counts", {1, 2, 40}}));
  const auto result = result_of(*port_);
  ASSERT_TRUE(result) << result.error().text();
  EXPECT_EQ(*result, Bytes{43});
  EXPECT_EQ(port_->progress(), 1u);
  EXPECT_FALSE(port_->take_result());
}

TEST_P(ConfinedConformance, WorkThatFails_ReturnsItsError) {
  ASSERT_TRUE(port_->begin({"fails"}));
  const auto result = result_of(*port_);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Errc::kChecksum);
  EXPECT_EQ(result.error().message, "file 'x': is damaged");
}

TEST_P(ConfinedConformance, SecondJobWhileOneRuns_IsBusyAndTheFirstIsUnharmed) {
  ASSERT_TRUE(port_->begin({"first"}));
  const Status second = port_->begin({"second"});
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, Errc::kBusy);
  EXPECT_EQ(result_of(*port_).value_or(Bytes()), as_bytes("first"));
}

TEST_P(ConfinedConformance, EndedJob_HasNoResultAndTheNextOneHasItsOwn) {
  ASSERT_TRUE(port_->begin({"first"}));
  port_->end();
  EXPECT_FALSE(port_->take_result());
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (!port_->begin({"second"})) {
    ASSERT_LT(std::chrono::steady_clock::now(), until);
    (void)port_->take_result();
  }
  EXPECT_EQ(result_of(*port_).value_or(Bytes()), as_bytes("second"));
}

TEST_P(ConfinedConformance, ManyJobsAndLargeResults_ComeInOrder) {
  for (int k = 0; k < 20; ++k) {
    ASSERT_TRUE(port_->begin({std::to_string(k)}));
    EXPECT_EQ(result_of(*port_).value_or(Bytes()), as_bytes(std::to_string(k)));
  }
  ASSERT_TRUE(port_->begin({"returns much"}));
  EXPECT_EQ(result_of(*port_).value_or(Bytes()), Bytes(kMax, 7));
}

constexpr ConfinedLimits kLimits{std::uint64_t{256} << 20, 20, std::chrono::seconds(60), kMax};

std::unique_ptr<ConfinedPort> process(ConfinedWork what, const ConfinedLimits& limits = kLimits) {
  auto made = ConfinedProcess::start(limits, std::move(what));
  EXPECT_TRUE(made) << made.error().text();
  return made ? std::move(*made) : nullptr;
}

const auto kWorldName = [](const auto& each) { return each.param.name; };

INSTANTIATE_TEST_SUITE_P(Worlds, ConfinedConformance,
                         testing::Values(ConfinedWorld{"Simulated",
                                                       [](ConfinedWork what) {
                                                         return std::make_unique<sim::SimConfined>(std::move(what));
                                                       }},
                                         ConfinedWorld{"Process",
                                                       [](ConfinedWork what) { return process(std::move(what)); }}),
                         kWorldName);

/// Does this once, then works again.
void expect_failure(ConfinedPort& port, const std::string& job, Errc code, const std::string& says) {
  ASSERT_TRUE(port.begin({job}));
  const auto result = result_of(port);
  ASSERT_FALSE(result) << job;
  EXPECT_EQ(result.error().code, code) << result.error().text();
  EXPECT_NE(result.error().message.find(says), std::string::npos) << result.error().text();
  ASSERT_TRUE(port.begin({"next"}));
  EXPECT_EQ(result_of(port).value_or(Bytes()), as_bytes("next"));
}

TEST(ConfinedProcess, WorkThatCrashes_IsAnErrorAndTheNextJobIsDone) {
  const auto port = process([](const ConfinedJob& job, const ConfinedProgress& progress) {
    if (job.what == "crashes") std::raise(SIGSEGV);
    if (job.what == "exits") ::_exit(0);
    if (job.what == "throws") throw std::runtime_error("no");
    return work(job, progress);
  });
  expect_failure(*port, "crashes", Errc::kInternal, "signal 11");
  expect_failure(*port, "exits", Errc::kInternal, "without a result");
  expect_failure(*port, "throws", Errc::kInternal, "without a result");
}

TEST(ConfinedProcess, WorkThatNeedsTooMuchMemory_SaysHowMuchThereIs) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer needs all addresses";
#endif
  const auto port = process([](const ConfinedJob& job, const ConfinedProgress& progress) {
    std::vector<Bytes> all;
    if (job.what == "grows") {
      for (int mib = 0; mib < 1024; ++mib) all.emplace_back(1 << 20, 1);
    }
    return work(job, progress);
  });
  expect_failure(*port, "grows", Errc::kOverload, "256 MiB");
}

TEST(ConfinedProcess, WorkThatHangs_IsEndedWhenItMakesNoProgress) {
  ConfinedLimits limits = kLimits;
  limits.without_progress = std::chrono::seconds(1);
  const auto port = process(
      [](const ConfinedJob& job, const ConfinedProgress& progress) {
        if (job.what == "hangs") ::pause();
        return work(job, progress);
      },
      limits);
  expect_failure(*port, "hangs", Errc::kOverload, "no progress for 1 s");
}

TEST(ConfinedProcess, WorkThatComputesForever_EndsAtItsProcessorTime) {
  ConfinedLimits limits = kLimits;
  limits.cpu_seconds = 1;
  const auto port = process(
      [](const ConfinedJob& job, const ConfinedProgress& progress) {
        if (job.what == "computes") {
          for (;;) progress();
        }
        return work(job, progress);
      },
      limits);
  expect_failure(*port, "computes", Errc::kOverload, "1 s of processor time");
}

TEST(ConfinedProcess, ResultBeyondItsLimit_IsAnError) {
  ConfinedLimits limits = kLimits;
  limits.result_bytes = 100;
  const auto port = process(work, limits);
  expect_failure(*port, "returns much", Errc::kTooLarge, "too large");
}

TEST(ConfinedProcess, MemoryOfTheProcess_IsNotChangedByWork) {
  int here = 1;
  const auto port = process([&](const ConfinedJob&, const ConfinedProgress&) -> Result<Bytes> {
    here += 1;
    return Bytes{static_cast<std::uint8_t>(here)};
  });
  for (int k = 0; k < 2; ++k) {
    ASSERT_TRUE(port->begin({"x"}));
    EXPECT_EQ(result_of(*port).value_or(Bytes()), Bytes{2});
  }
  EXPECT_EQ(here, 1);
}

TEST(ConfinedProcess, ConfinedWorker_StillReturnsItsResult) {
  const auto port = process([](const ConfinedJob& job, const ConfinedProgress& progress) -> Result<Bytes> {
    linux_os::Confinement what;
    what.calls = linux_os::Confinement::Calls::kFilesAndMemory;
    if (const auto done = linux_os::confine(what); !done) return fail(done.error());
    return work(job, progress);
  });
  ASSERT_TRUE(port->begin({"returns much"}));
  const auto result = result_of(*port);
  ASSERT_TRUE(result) << result.error().text();
  EXPECT_EQ(*result, Bytes(kMax, 7));
}

}  // namespace
}  // namespace nodal::hal
