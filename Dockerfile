# docker build -t merge-cosim . && docker run --rm merge-cosim            # make demo
#                                  docker run --rm merge-cosim make test
FROM python:3.12-slim
# What the wheels of SUMO need of the system, also without a window, and make.
RUN apt-get update && apt-get install -y --no-install-recommends \
    make libatomic1 libexpat1 libgl1 libx11-6 libxext6 libxrender1 && rm -rf /var/lib/apt/lists/*
WORKDIR /merge-cosim
COPY . .
RUN make .venv/installed
CMD ["make", "demo"]
