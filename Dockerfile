# render2mpeg in a container:
#
#     .ci/third_party                       writes THIRD-PARTY.txt, which the image contains
#     docker build --tag render2mpeg .
#     docker run --rm --user "$(id -u):$(id -g)" --volume "$PWD:/films" render2mpeg render scene.glb
#
# Scenes are read from /films, and films written there. For --also, install ffmpeg in an image of your own from this one.

# The oldest Rust that is supported.
FROM rust:1.89-slim-bookworm AS build
WORKDIR /source
COPY . .
RUN cargo build --release --locked --package render2mpeg && strip target/release/render2mpeg

FROM debian:bookworm-slim
COPY --from=build /source/target/release/render2mpeg /usr/local/bin/
COPY README.md LICENSE-MIT LICENSE-APACHE THIRD-PARTY.txt /usr/share/doc/render2mpeg/
# A user without rights; --user names the one who owns the films.
USER 65534:65534
WORKDIR /films
ENTRYPOINT ["render2mpeg"]
