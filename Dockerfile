# docker build -t merge-cosim . && docker run --rm merge-cosim            # make demo
#                                  docker run --rm merge-cosim make test
FROM python:3.12-slim
RUN apt-get update && apt-get install -y --no-install-recommends make && rm -rf /var/lib/apt/lists/*
WORKDIR /merge-cosim
COPY . .
RUN make .venv/installed
CMD ["make", "demo"]
