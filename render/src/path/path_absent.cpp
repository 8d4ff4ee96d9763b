#include "path/path_renderer.h"
#include "supple/core/error.h"

namespace supple::render {

std::unique_ptr<Renderer> make_path_renderer(const RenderSettings& /*settings*/) {
  throw Error(ErrorKind::Usage, Fault{.place = "render",
                                      .key = "renderer",
                                      .expected = "this build has no path tracer: the component Embree 3 was not found",
                                      .found = {},
                                      .hint = "apt-get install libembree-dev and configure again, or use 'renderer: gl'"});
}

}  // namespace supple::render
