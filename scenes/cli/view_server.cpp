#include "view_server.h"

#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <charconv>
#include <chrono>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "supple/core/error.h"
#include "supple/core/interrupt.h"
#include "supple/core/out_of_threads.h"

namespace supple::tool {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using tcp = asio::ip::tcp;
using Request = http::request<http::empty_body>;
using Response = http::response<http::string_body>;

/// The frames of a run, made when they are first requested.
class Frames {
 public:
  Frames(scenes::Scene scene, const ViewServer::Settings& settings) : scene_(std::move(scene)), settings_(settings) {}

  std::string page() { return scenes::following_page(view()); }

  /// Length and content of frames from `first` on, as many as are there within the limits of an answer.
  std::string from(int first) {
    using Clock = std::chrono::steady_clock;
    constexpr std::chrono::milliseconds kPatience(300);
    constexpr std::size_t kLargest = std::size_t{4} << 20;
    const Clock::time_point begin = Clock::now();
    std::string answer;
    for (const auto& [frame, bytes] : made_) {
      if (frame >= first && answer.size() < kLargest) append(answer, bytes);
    }
    while (next_ <= scene_.frame_count() && answer.size() < kLargest && Clock::now() - begin < kPatience) {
      std::optional<std::string> bytes = view().frame(next_);
      if (!bytes) break;
      if (next_ >= first) append(answer, *bytes);
      made_.emplace_back(next_++, std::move(*bytes));
    }
    return answer;
  }

 private:
  scenes::RunView& view() {
    const scenes::ViewOptions options{.folder = settings_.folder, .threads = 1, .memory = settings_.memory, .interrupt = settings_.interrupt};
    if (!view_) view_.emplace(scene_, options, settings_.cells);
    return *view_;
  }
  static void append(std::string& answer, const std::string& bytes) {
    for (unsigned k = 0; k < 4; ++k) answer += static_cast<char>((bytes.size() >> (8U * k)) & 0xFFU);
    answer += bytes;
  }

  scenes::Scene scene_;
  const ViewServer::Settings& settings_;
  std::optional<scenes::RunView> view_;
  std::vector<std::pair<int, std::string>> made_;
  int next_ = 1;
};

Response reply(const Request& request, http::status status, std::string type, std::string body) {
  Response response(status, request.version());
  response.set(http::field::content_type, std::move(type));
  response.set(http::field::cache_control, "no-store");
  response.set("X-Content-Type-Options", "nosniff");
  response.keep_alive(request.keep_alive());
  response.body() = std::move(body);
  response.prepare_payload();
  return response;
}

/// Pages of other names could reach this server by a name that they point here; their requests name another host.
bool is_from_here(const Request& request) {
  const std::string host(request[http::field::host]);
  const std::string name = host.substr(0, host.find(':'));
  return name == "127.0.0.1" || name == "localhost";
}

}  // namespace

struct ViewServer::Impl {
  Impl(scenes::Scene scene, Settings s) : settings(std::move(s)), frames(std::move(scene), settings), acceptor(context) {}

  void listen();
  void accept();
  Response answer(const Request& request);
  Response answer_frames(const Request& request, int first);

  Settings settings;
  Frames frames;
  std::atomic<bool> began{false}, ended{false};
  asio::io_context context{1};
  tcp::acceptor acceptor;
  std::thread thread;
};

namespace {

/// One connection; it ends by itself where nothing is heard for a while.
class Session : public std::enable_shared_from_this<Session> {
 public:
  Session(tcp::socket socket, std::function<Response(const Request&)> answer) : stream_(std::move(socket)), answer_(std::move(answer)) {}

  void read() {
    constexpr std::chrono::seconds kPatience(60);
    request_ = {};
    stream_.expires_after(kPatience);
    http::async_read(stream_, buffer_, request_, [self = shared_from_this()](beast::error_code failed, std::size_t) {
      if (!failed) self->write();
    });
  }

 private:
  void write() {
    response_ = answer_(request_);
    http::async_write(stream_, response_, [self = shared_from_this()](beast::error_code failed, std::size_t) {
      if (!failed && self->response_.keep_alive()) self->read();
    });
  }

  beast::tcp_stream stream_;
  std::function<Response(const Request&)> answer_;
  beast::flat_buffer buffer_{std::size_t{1} << 16};
  Request request_;
  Response response_;
};

}  // namespace

void ViewServer::Impl::listen() {
  const tcp::endpoint here(asio::ip::address_v4::loopback(), static_cast<std::uint16_t>(settings.port));
  beast::error_code failed;
  acceptor.open(here.protocol(), failed);
  if (!failed) acceptor.set_option(asio::socket_base::reuse_address(true), failed);
  if (!failed) acceptor.bind(here, failed);
  if (!failed) acceptor.listen(asio::socket_base::max_listen_connections, failed);
  if (!failed) return;
  throw Error(ErrorKind::Io, Fault{.place = "127.0.0.1:" + std::to_string(settings.port),
                                   .key = {},
                                   .expected = "cannot be served: " + failed.message(),
                                   .found = {},
                                   .hint = "choose another --port"});
}

void ViewServer::Impl::accept() {
  acceptor.async_accept([this](beast::error_code failed, tcp::socket socket) {
    if (failed == asio::error::operation_aborted) return;
    if (!failed) std::make_shared<Session>(std::move(socket), [this](const Request& request) { return answer(request); })->read();
    accept();
  });
}

Response ViewServer::Impl::answer_frames(const Request& request, int first) {
  const bool last_call = ended;  // before the states are looked for
  Response response = reply(request, http::status::ok, "application/octet-stream", began ? frames.from(first) : std::string());
  response.set("X-Run-Ended", last_call ? "true" : "false");
  return response;
}

Response ViewServer::Impl::answer(const Request& request) try {
  constexpr std::string_view kFrames = "/frames?from=";
  const std::string target(request.target());
  if (!is_from_here(request)) return reply(request, http::status::forbidden, "text/plain", "Only 127.0.0.1 and localhost are served.\n");
  if (request.method() != http::verb::get) return reply(request, http::status::method_not_allowed, "text/plain", "Only GET is answered.\n");
  if (target == "/") return reply(request, http::status::ok, "text/html; charset=utf-8", frames.page());
  if (!target.starts_with(kFrames)) return reply(request, http::status::not_found, "text/plain", "There is only / here.\n");
  int first = 0;
  const char* const end = target.data() + target.size();
  const auto parsed = std::from_chars(target.data() + kFrames.size(), end, first);
  if (parsed.ec != std::errc() || parsed.ptr != end || first < 1) {
    return reply(request, http::status::bad_request, "text/plain", "Expected a number of a frame.\n");
  }
  return answer_frames(request, first);
} catch (const std::exception& failure) {  // the run goes on without a view
  return reply(request, http::status::internal_server_error, "text/plain", failure.what());
}

ViewServer::ViewServer(scenes::Scene scene, Settings settings) : impl_(std::make_unique<Impl>(std::move(scene), std::move(settings))) {
  impl_->listen();
  impl_->accept();
  try {
    impl_->thread = std::thread([impl = impl_.get()] { impl->context.run(); });
  } catch (const std::system_error&) {
    throw_out_of_threads();
  }
}

ViewServer::~ViewServer() {
  impl_->context.stop();
  impl_->thread.join();
}

std::string ViewServer::address() const { return "http://127.0.0.1:" + std::to_string(impl_->acceptor.local_endpoint().port()) + '/'; }
void ViewServer::begin() { impl_->began = true; }
void ViewServer::end() { impl_->began = impl_->ended = true; }

void ViewServer::wait() const {
  constexpr std::chrono::milliseconds kSlice(100);
  while (*impl_->settings.interrupt == 0) std::this_thread::sleep_for(kSlice);
}

}  // namespace supple::tool
