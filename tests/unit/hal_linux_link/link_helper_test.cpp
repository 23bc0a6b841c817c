// Links that another process opens.
#include "hal/linux/link/link_helper.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "hal/linux/link/socket_link.h"
#include "hal/linux/link/wait.h"
#include "tests/support/pictures.h"
#include "tests/support/process.h"

namespace nodal::hal {
namespace {

std::span<const std::uint8_t> as_bytes(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

/// Reads until `wanted` bytes are there, or the link ends; then `error` is why.
std::string read_all(LinkPort& link, std::size_t wanted, Error* error = nullptr) {
  std::string all;
  std::vector<std::uint8_t> buffer(65536);
  (void)test::wait_until([&] {
    const auto got = link.read(buffer);
    if (!got && error != nullptr) *error = got.error();
    if (!got) return true;
    all.append(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(*got));
    return all.size() >= wanted;
  });
  return all;
}

std::unique_ptr<LinkHelper> helper_for(const std::vector<std::string>& command) {
  auto helper = LinkHelper::start([command] { return spawn_link(command); });
  EXPECT_TRUE(helper) << helper.error().text();
  return std::move(*helper);
}

TEST(LinkHelper, BytesOfALink_ArriveBothWaysInOrder_MoreThanItsBuffers) {
  const auto helper = helper_for({"cat"});
  auto link = helper->connect();
  ASSERT_TRUE(link) << link.error().text();
  std::string sent;
  for (int i = 0; sent.size() < 8 * LinkHelper::kBuffer; ++i) sent += std::to_string(i) + " ";
  std::string back;
  std::vector<std::uint8_t> buffer(65536);
  std::size_t at = 0;
  ASSERT_TRUE(test::wait_until([&] {
    if (at < sent.size()) at += (*link)->write(as_bytes(sent).subspan(at)).value_or(0);
    const std::size_t got = (*link)->read(buffer).value_or(0);
    back.append(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(got));
    return back.size() >= sent.size();
  }));
  EXPECT_EQ(back, sent);
}

TEST(LinkHelper, SeveralLinks_AreApart) {
  const auto helper = helper_for({"cat"});
  auto first = helper->connect(), second = helper->connect();
  ASSERT_TRUE(first && second);
  ASSERT_TRUE((*first)->write(as_bytes("one")));
  ASSERT_TRUE((*second)->write(as_bytes("two")));
  EXPECT_EQ(read_all(**first, 3), "one");
  first->reset();
  EXPECT_EQ(read_all(**second, 3), "two");
}

/// A link that takes a while to close, as a cable's farewell does, and leaves a file then.
class SlowlyClosedLink final : public LinkPort {
 public:
  explicit SlowlyClosedLink(std::filesystem::path closed) : closed_(std::move(closed)) {}
  ~SlowlyClosedLink() override {
    ::usleep(200'000);
    std::ofstream(closed_) << "closed";
  }
  Result<std::size_t> read(std::span<std::uint8_t>) override { return 0; }
  Result<std::size_t> write(std::span<const std::uint8_t> from) override { return from.size(); }
  const std::string& peer() const override { return peer_; }
  std::optional<PeerIdentity> identity() const override { return std::nullopt; }
  void add_wake_ups(WakeUps&, bool, bool) const override {}

 private:
  const std::filesystem::path closed_;
  const std::string peer_ = "slowly closed";
};

TEST(LinkHelper, ALinkThatIsDestroyed_IsClosedWhenItsDestructorReturns) {
  const test::TemporaryFolder folder;
  auto helper = LinkHelper::start(
      [&]() -> Result<std::unique_ptr<LinkPort>> { return std::make_unique<SlowlyClosedLink>(folder / "closed"); });
  ASSERT_TRUE(helper);
  auto link = (*helper)->connect();
  ASSERT_TRUE(link) << link.error().text();
  link->reset();
  EXPECT_TRUE(std::filesystem::exists(folder / "closed")) << "the next program would find the cable taken";
}

TEST(LinkHelper, ALinkThatCannotBeOpened_HasTheErrorOfItsKind) {
  const auto programs = helper_for({"nodal-no-such-program"});
  EXPECT_EQ(programs->connect().error().code, Errc::kNotFound);
  auto sockets = LinkHelper::start([] { return connect_link("unix:/nonexistent/nodal.sock"); });
  ASSERT_TRUE(sockets);
  const auto link = (*sockets)->connect();
  ASSERT_FALSE(link);
  EXPECT_EQ(link.error().code, Errc::kUnreachable);
  EXPECT_NE(link.error().message.find("unix:/nonexistent/nodal.sock: there is no such socket"), std::string::npos)
      << link.error().message;
}

TEST(LinkHelper, AProgramThatEnds_LeavesItsLastBytesAndItsExitCode) {
  const auto helper = helper_for({"sh", "-c", "printf last; exit 3"});
  auto link = helper->connect();
  ASSERT_TRUE(link);
  Error why;
  EXPECT_EQ(read_all(**link, 100, &why), "last");
  EXPECT_EQ(why.code, Errc::kLinkClosed);
  EXPECT_NE(why.message.find("exit code 3"), std::string::npos) << why.message;
}

TEST(LinkHelper, ALinkThatIsClosed_EndsItsProgram_AlsoOneThatIgnoresTheEndOfItsInput) {
  const test::TemporaryFolder folder;
  const auto helper = helper_for({"sh", "-c", "echo $$ > " + (folder / "pid").string() + "; exec sleep 1000"});
  {
    auto link = helper->connect();
    ASSERT_TRUE(link);
    ASSERT_TRUE(test::wait_until([&] {
      int pid = 0;
      return bool(std::ifstream(folder / "pid") >> pid);
    }));
  }
  int pid = 0;
  std::ifstream(folder / "pid") >> pid;
  ASSERT_GT(pid, 0);
  EXPECT_TRUE(test::wait_until([&] { return ::kill(pid, 0) != 0; })) << "the program goes on";
}

TEST(LinkHelper, ThatIsDestroyed_EndsAndLeavesItsLinks) {
  auto helper = helper_for({"cat"});
  auto link = helper->connect();
  ASSERT_TRUE(link);
  helper.reset();
  ASSERT_TRUE((*link)->write(as_bytes("still")));
  EXPECT_EQ(read_all(**link, 5), "still");
}

}  // namespace
}  // namespace nodal::hal
